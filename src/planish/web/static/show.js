// A job on the page: at work, done, failed.

const STAGES = [
  ["read", "Reading"],
  ["clean", "Cleaning the mesh"],
  ["flatten", "Flattening"],
  ["turn", "Turning the page"],
  ["render", "Drawing the page"],
  ["unshade", "Removing the shading"],
  ["binarize", "Black and white"],
  ["measure", "Measuring"],
  ["write", "Writing"],
];
const WITHIN = { split: "turn", text: "measure", look: "write" };
const FILES = {
  "view.html": "Page to look at, HTML",
  "page.tif": "Page, TIFF",
  "page.png": "Page, PNG",
  "page.jpg": "Page, JPEG",
  "page.pdf": "Page, PDF",
  "page-bw.png": "Black and white, PNG",
  "flat.obj": "Flat mesh, OBJ",
  "report.json": "Report, JSON",
};
const HIDDEN = new Set(["preview.jpg"]);

export const byId = (id) => document.getElementById(id);

export function size(bytes) {
  return bytes < 1e5 ? `${Math.max(1, Math.round(bytes / 1e3))} kB` : `${(bytes / 1e6).toFixed(bytes < 1e7 ? 1 : 0)} MB`;
}

export function element(tag, text = "", attributes = {}) {
  const made = Object.assign(document.createElement(tag), attributes);
  if (text) made.textContent = text;
  return made;
}

/** Show one of the four sections; the reader's place moves to its title. */
export function turnTo(id, title) {
  for (const section of document.querySelectorAll("main > section")) section.hidden = section.id !== id;
  const heading = byId(`${id}-title`);
  if (title) heading.textContent = title;
  document.title = title ? `${title} – planish` : "planish";
  heading.focus({ preventScroll: true });
  window.scrollTo(0, 0);
}

function say(text) {
  const status = byId("status");
  if (status.textContent !== text) status.textContent = text; // said aloud only when it changes
}

export function sending(title, share) {
  if (byId("working").hidden) turnTo("working", title);
  byId("stages").replaceChildren();
  byId("bar").value = share;
  say(share < 1 ? "Sending the files" : "Looking at the files");
}

export function working(job) {
  if (byId("working").hidden || byId("working-title").textContent !== job.title) turnTo("working", job.title);
  const stage = WITHIN[job.stage] ?? job.stage;
  const now = STAGES.findIndex(([name]) => name === stage);
  if (job.state === "queued") {
    byId("bar").removeAttribute("value");
    say(job.ahead ? `Waiting: ${job.ahead} before this one` : "Waiting for a free place");
  } else {
    byId("bar").value = (Math.max(now, 0) + job.share * (now >= 0)) / STAGES.length;
    say(now >= 0 ? STAGES[now][1] : "Beginning");
  }
  const items = STAGES.map(([, words], k) => element("li", words, { className: k < now ? "past" : k === now ? "now" : "" }));
  if (now >= 0) items[now].setAttribute("aria-current", "step");
  byId("stages").replaceChildren(...items);
}

export function done(job) {
  turnTo("done", job.title);
  byId("outcome").textContent = job.outcome;
  byId("outcome").className = job.settled ? "" : "unsettled";
  byId("look").replaceChildren(...look(job));
  const order = Object.keys(FILES);
  const place = (file) => order.indexOf(file.name.replace(/-\d\./, "."));
  const shown = job.files.filter((file) => !HIDDEN.has(file.name)).sort((a, b) => place(a) - place(b));
  const all = link(job.all_files, "Everything, zip", shown.reduce((sum, file) => sum + file.bytes, 0), "whole");
  byId("files").replaceChildren(all, ...shown.map((file) => link(file.href, words(file.name), file.bytes)));
  byId("figures").replaceChildren(...job.figures.filter(({ what }) => what !== "outcome").flatMap(({ what, how_much }) => [element("dt", what), element("dd", how_much)]));
  byId("warnings").hidden = job.warnings.length === 0;
  byId("warnings").querySelector("ul").replaceChildren(...job.warnings.map((warning) => element("li", warning)));
  byId("expires").textContent = `The results are removed on ${new Date(job.expires).toLocaleString(undefined, { dateStyle: "medium", timeStyle: "short" })}.`;
}

function words(name) {
  const of = /^page(-bw)?-(\d)(\..+)$/.exec(name); // one of two pages of a book
  return of ? `${FILES[`page${of[1] ?? ""}${of[3]}`]}, ${of[2]} of 2` : FILES[name] ?? name;
}

function link(href, text, bytes, className = "") {
  const item = element("li");
  const anchor = element("a", "", { href, className, download: "" });
  anchor.append(element("span", text), element("span", size(bytes)));
  item.append(anchor);
  return item;
}

function look(job) {
  const preview = job.files.find((file) => file.name === "preview.jpg");
  const view = job.files.find((file) => file.name === "view.html");
  const parts = preview ? [element("img", "", { src: preview.href, alt: `The restored page of ${job.title}` })] : [];
  if (view) parts.unshift(element("a", "Look at it: in 3D, before and after, how true", { href: view.href, target: "_blank", rel: "noopener", className: "button" }));
  return parts;
}

export function failed(title, sentence) {
  turnTo("failed", `${title} could not be restored`);
  byId("sentence").textContent = sentence;
}
