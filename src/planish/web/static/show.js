// Rendering of a job: running, done, failed.

const STAGES = [
  ["photos", "Finding the sheet’s shape on its photos"],
  ["read", "Reading"],
  ["clean", "Repairing the mesh"],
  ["flatten", "Flattening"],
  ["turn", "Orienting the page"],
  ["render", "Rendering the page"],
  ["unshade", "Removing the shading"],
  ["measure", "Measuring"],
  ["binarize", "Binarizing"],
  ["write", "Writing"],
];
let measured = ""; // the job whose sheet is measured from photos first
const WITHIN = { split: "turn", text: "measure", look: "write" };
const FILES = {
  "view.html": "Interactive view, HTML",
  "page.tif": "Page, TIFF",
  "page.png": "Page, PNG",
  "page.jpg": "Page, JPEG",
  "page.pdf": "Page, PDF",
  "page-bw.png": "Binarized page, PNG",
  "flat.obj": "Flattened mesh, OBJ",
  "report.json": "Report, JSON",
};
const HIDDEN = new Set(["preview.jpg"]);

export const byId = (id) => document.getElementById(id);

export function size(bytes) {
  return bytes < 1e5 ? `${Math.max(1, Math.round(bytes / 1e3))} kB` : `${(bytes / 1e6).toFixed(bytes < 1e7 ? 1 : 0)} MB`;
}

export function element(tag, text = "", attributes = {}) {
  const created = Object.assign(document.createElement(tag), attributes);
  if (text) created.textContent = text;
  return created;
}

/** What has become of a job, for the list of pages. */
export function badge({ state, verdict }) {
  const word = state === "done" ? verdict : state === "failed" ? "failed" : "running";
  return element("span", word, { className: `badge ${(word ?? "").replaceAll(" ", "-")}` });
}

/** Show one of the four sections, and move the focus to its heading. */
export function showSection(id, title) {
  for (const section of document.querySelectorAll("main > section")) section.hidden = section.id !== id;
  const heading = byId(`${id}-title`);
  if (title) heading.textContent = title;
  document.title = title ? `${title} – planish` : "planish";
  heading.focus({ preventScroll: true });
  window.scrollTo(0, 0);
}

function setStatus(text) {
  const status = byId("status");
  if (status.textContent !== text) status.textContent = text; // screen readers announce changes only
}

export function sending(title, share) {
  if (byId("working").hidden) showSection("working", title);
  byId("stages").replaceChildren();
  byId("bar").value = share;
  setStatus(share < 1 ? "Uploading the files" : "Checking the files");
}

export function working(job) {
  if (byId("working").hidden || byId("working-title").textContent !== job.title) showSection("working", job.title);
  const stage = WITHIN[job.stage] ?? job.stage;
  if (stage === "photos") measured = job.id;
  const stages = measured === job.id ? STAGES : STAGES.slice(1);
  const now = stages.findIndex(([name]) => name === stage);
  if (job.state === "queued") {
    byId("bar").removeAttribute("value");
    setStatus(job.preparing ? "Preparing: the first start takes a minute or two" : job.ahead ? `Queued: ${job.ahead} before this one` : "Queued: next to start");
  } else {
    byId("bar").value = (Math.max(now, 0) + job.share * (now >= 0)) / stages.length;
    setStatus(now >= 0 ? stages[now][1] : "Starting");
  }
  const items = stages.map(([, words], k) => element("li", words, { className: k < now ? "past" : k === now ? "now" : "" }));
  if (now >= 0) items[now].setAttribute("aria-current", "step");
  byId("stages").replaceChildren(...items);
}

export function done(job) {
  showSection("done", job.title);
  byId("verdict").textContent = job.verdict[0].toUpperCase() + job.verdict.slice(1);
  byId("verdict").className = `verdict ${job.verdict.replaceAll(" ", "-")}`;
  byId("reasons").replaceChildren(...(job.reasons.length ? job.reasons : ["Nothing that is known speaks against using this page"]).map((reason) => element("li", asSentence(reason))));
  byId("warnings").hidden = job.warnings.length === 0;
  byId("warnings").querySelector("ul").replaceChildren(...job.warnings.map((warning) => element("li", asSentence(warning))));
  byId("preview").replaceChildren(...preview(job));
  const order = Object.keys(FILES);
  const place = (file) => order.indexOf(file.name.replace(/-\d\./, "."));
  const shown = job.files.filter((file) => !HIDDEN.has(file.name)).sort((a, b) => place(a) - place(b));
  const all = link(job.all_files, "All files, zip", shown.reduce((sum, file) => sum + file.bytes, 0), "whole");
  byId("files").replaceChildren(all, ...shown.map((file) => link(file.href, words(file.name), file.bytes)));
  byId("figures").replaceChildren(...job.figures.filter(({ what }) => !/(verdict|outcome)$/.test(what)).flatMap(figure));
  byId("expires").textContent = `The results are deleted on ${new Date(job.expires).toLocaleString(undefined, { dateStyle: "medium", timeStyle: "short" })}.`;
}

function asSentence(text) {
  const aFile = /^\S+\.\w/.test(text);  // a file's name stays as it is
  const capital = aFile ? text : text[0].toUpperCase() + text.slice(1);
  return capital.endsWith(".") ? capital : `${capital}.`;
}

function figure({ what, how_much, usual }) {
  const value = element("dd", how_much);
  if (usual) value.append(element("small", `usual: ${usual}`));
  return [element("dt", what), value];
}

function words(name) {
  const of = /^(page|page-bw|view|report)-(\d)(\..+)$/.exec(name); // one of two pages of a book
  return of ? `${FILES[`${of[1]}${of[3]}`]}, ${of[2]} of 2` : FILES[name] ?? name;
}

function link(href, text, bytes, className = "") {
  const item = element("li");
  const anchor = element("a", "", { href, className, download: "" });
  anchor.append(element("span", text), element("span", size(bytes)));
  item.append(anchor);
  return item;
}

function preview(job) {
  const image = job.files.find((file) => file.name === "preview.jpg");
  const views = job.files.filter((file) => /^view.*\.html$/.test(file.name));
  const parts = image ? [element("img", "", { src: image.href, alt: `The restored page of ${job.title}` })] : [];
  parts.unshift(...views.map((view, k) => element("a", `Open the interactive view${views.length > 1 ? ` of page ${k + 1}` : ""}`, { href: view.href, target: "_blank", rel: "noopener", className: "button" })));
  return parts;
}

export function failed(title, text) {
  showSection("failed", `${title} could not be restored`);
  byId("sentence").textContent = asSentence(text);
}
