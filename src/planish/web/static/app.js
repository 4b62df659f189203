// The page: choose and upload files, then follow the job. The URL fragment holds the job id, so that a reload finds it.

import * as api from "./api.js";
import { isImage, recognize } from "./files.js";
import { forget, kept, remember } from "./kept.js";
import { mark } from "./mark.js";
import { badge, byId, done, element, failed, sending, size, showSection, working } from "./show.js";
import { turn } from "./turn.js";

const POLL_MS = 3000;
let chosen = [];
let seen = { kind: "none", images: [], missing: null, sentence: "" };
let marks = { outline: null, distance: null, cut: null };
let points = null; // of the chosen scan: { files, data }
let unsubscribe = () => {};
let upload = null;
let limits = null;

const named = () => new URLSearchParams(location.hash.slice(1)).get("job");

function choose(files) {
  for (const file of files) {
    chosen = chosen.filter((other) => other.name !== file.name);
    chosen.push(file);
  }
  return changed();
}

/** Add photos: those taken just now are all called image.jpg on some phones, so they get numbers. */
function choosePhotos(files) {
  for (const file of files) {
    if (chosen.some((other) => other.original === file.name && other.size === file.size && other.lastModified === file.lastModified)) continue;
    const [, stem, suffix] = /^(.*?)(\.[^.]*)?$/.exec(file.name);
    let name = file.name;
    for (let k = 2; chosen.some((other) => other.name === name); k++) name = `${stem}-${k}${suffix ?? ""}`;
    const renamed = new File([file], name, { type: file.type, lastModified: file.lastModified });
    chosen.push(Object.assign(renamed, { original: file.name }));
  }
  return changed();
}

/** Show the chosen files, what they are, and what is missing among them. */
async function changed() {
  byId("chosen").replaceChildren(...chosen.map((file) => {
    const item = element("li");
    const drop = element("button", "Remove", { type: "button" });
    drop.append(element("span", ` ${file.name}`, { className: "unseen" }));
    drop.onclick = () => { chosen = chosen.filter((other) => other !== file); changed(); byId("scan").focus(); };
    item.append(element("span", file.name, { className: "what" }), element("span", size(file.size), { className: "much" }), drop);
    return item;
  }));
  refuse("");
  seen = await recognize(chosen);
  if (!seen.images.some(({ name }) => name === marks.outline?.file)) marks.outline = null;
  if (!seen.images.some(({ name }) => name === marks.distance?.file)) marks.distance = null;
  byId("recognized").textContent = seen.sentence;
  byId("missing").hidden = !seen.missing;
  byId("missing").querySelector("span").textContent = seen.missing ?? "";
  byId("size").hidden = !seen.kind.startsWith("photo");
  for (const part of byId("size").querySelectorAll(".several")) part.hidden = seen.kind !== "photos";
  if (seen.kind !== "scan" || (points && points.files !== filesKey())) marks.cut = points = null;
  byId("marks").hidden = !canDraw() && !canCut();
  byId("draw").hidden = !canDraw();
  byId("cut").hidden = !canCut();
  showMarks();
}

const filesKey = () => [...chosen.map(({ name, size, lastModified }) => [name, size, lastModified]), byId("form").units.value].join();

const canDraw = () => seen.images.length === 1 && ["photo", "scan"].includes(seen.kind);

const canCut = () => seen.kind === "scan" && !seen.missing;

function showMarks() {
  const { outline, distance, cut } = marks;
  const corners = (outline ?? cut)?.points.length;
  byId("draw").textContent = outline ? "Change the outline" : "Draw the sheet’s outline";
  byId("drawn").textContent = corners ? `The sheet has an outline of ${corners} corners; the rest is left out.` : "Only needed where the sheet is not plain to see.";
  byId("erase").hidden = !corners;
  byId("measured").textContent = distance ? `${distance.distance} mm, on ${distance.file}` : "";
}

async function drawOutline() {
  const asStored = seen.kind === "scan"; // texture coordinates are of the pixels as stored
  const outline = await mark("outline", seen.images, { asStored, before: marks.outline });
  if (outline) Object.assign(marks, { outline, cut: null });
  showMarks();
}

/** Let the user turn the scan, and draw the sheet's outline on what is seen of it. */
async function cutScan() {
  const files = filesKey();
  if (points?.files !== files) {
    byId("cut").disabled = true;
    byId("drawn").textContent = "Reading the scan…";
    try {
      const form = withFiles(new FormData());
      form.set("units", byId("form").units.value || "auto");
      points = { files, data: await api.points(form) };
    } catch (problem) {
      refuse(problem instanceof api.Refused ? problem.message : "The scan could not be read.");
      return showMarks();
    } finally {
      byId("cut").disabled = false;
    }
    if (files !== filesKey()) return changed();
  }
  const turned = await turn(points.data);
  const outline = turned && (await mark("outline", [turned.file]));
  if (outline) Object.assign(marks, { cut: { ...outline, view: turned.view }, outline: null });
  showMarks();
}

async function markDistance() {
  marks.distance = (await mark("distance", seen.images, { before: marks.distance })) ?? marks.distance;
  if (marks.distance) oneSize(null);
  showMarks();
}

/** One answer tells how large the sheet is: the others are taken back. */
function oneSize(given) {
  for (const field of byId("size").querySelectorAll("input, select")) {
    if (field !== given) field.value = field.tagName === "SELECT" ? "unknown" : "";
  }
  if (given) marks.distance = null;
  showMarks();
}

function refuse(sentence) {
  byId("refused").textContent = sentence;
  byId("refused").hidden = !sentence;
}

function formData() {
  const form = new FormData(byId("form"));
  form.delete("scan");
  if (!seen.kind.startsWith("photo")) for (const name of ["paper", "width-mm", "marker-mm"]) form.delete(name);
  if (seen.kind === "photo") form.delete("marker-mm");
  for (const [name, value] of [...form]) if (value === "") form.delete(name);
  const at = (points) => points.map((point) => point.join(","));
  const { outline, distance, cut } = marks;
  if (outline && canDraw()) form.set("outline", `${outline.width}x${outline.height} ${at(outline.points).join(" ")}`);
  if (cut && canCut()) form.set("cut", `${cut.width}x${cut.height} ${at([...cut.view, ...cut.points]).join(" ")}`);
  if (distance && seen.kind === "photos") {
    form.set("distance-mm", distance.distance);
    form.set("between", [distance.file, ...at(distance.points)].join(","));
  }
  return withFiles(form);
}

function withFiles(form) {
  for (const file of chosen) form.append("scan", file, file.name);
  return form;
}

async function submit(event) {
  event.preventDefault();
  if (!chosen.length) return refuse("Choose photos, or the files of a scan, first.");
  if (seen.missing) {
    refuse(seen.missing);
    return byId("add").focus();
  }
  const form = formData();
  const bytes = [...form.values()].reduce((sum, value) => sum + (value.size ?? 0), 0);
  if (limits && bytes > limits.upload_mb * 1e6) return refuse(`The files have ${size(bytes)}; the limit is ${limits.upload_mb} MB.`);
  refuse("");
  const title = seen.kind === "photos" ? `${chosen.length} photos` : (chosen.find((file) => !isImage(file)) ?? chosen[0]).name;
  upload = new AbortController();
  sending(title, 0);
  try {
    const job = await api.send(form, (share) => sending(title, share), upload.signal);
    remember(job);
    location.hash = `job=${job.id}`;
  } catch (problem) {
    start();
    if (problem instanceof api.Refused) refuse(problem.message);
  } finally {
    upload = null;
  }
}

function show(job, id) {
  if (job === null) {
    forget(id);
    return failed("This page", "It no longer exists: results are deleted after a while.");
  }
  remember(job);
  if (job.state === "done") {
    done(job);
    byId("redraw").hidden = !canDraw();
    byId("recut").hidden = !canCut();
  } else if (job.state === "failed") failed(job.title, job.sentence);
  else working(job);
}

function start() {
  showSection("start");
  showRecent();
  Promise.all(kept().map(async ({ id }) => {
    const job = await api.job(id);
    if (job) remember(job); else if (job === null) forget(id);
  })).then(showRecent);
}

function showRecent() {
  const jobs = kept();
  byId("recent").hidden = jobs.length === 0;
  byId("recent").querySelector("ul").replaceChildren(...jobs.map((job) => {
    const item = element("li");
    const made = job.created ? new Date(job.created).toLocaleString(undefined, { dateStyle: "short", timeStyle: "short" }) : "";
    item.append(element("a", job.title, { href: `#job=${job.id}` }), badge(job), element("span", made, { className: "small" }));
    return item;
  }));
}

/** Back to the start; the chosen files stay, so that another try needs no second choosing. */
function again() {
  location.hash = "";
  if (!named()) start();
}

function another() {
  chosen = [];
  byId("form").reset();
  changed();
  again();
}

async function route() {
  unsubscribe();
  unsubscribe = () => {};
  const id = named();
  if (!id) return start();
  const job = await api.job(id);
  if (job === undefined) return failed("This page", "The service cannot be reached. Is it still running?");
  if (job === null || job.state === "done" || job.state === "failed") return show(job, id);
  unsubscribe = api.follow(id, (state) => show(state, id));
}

async function leave() {
  if (upload) return upload.abort();
  const id = named();
  unsubscribe();
  await api.remove(id);
  forget(id);
  location.hash = "";
}

/** Until the service has compiled, say so. */
async function watchPreparing() {
  const state = await api.health();
  byId("preparing").hidden = !state || state.warm;
  if (state && !state.warm) setTimeout(watchPreparing, POLL_MS);
  return state;
}

const drop = byId("drop");
for (const kind of ["dragenter", "dragover"]) drop.addEventListener(kind, (event) => { event.preventDefault(); drop.classList.add("over"); });
for (const kind of ["dragleave", "drop"]) drop.addEventListener(kind, (event) => { event.preventDefault(); drop.classList.remove("over"); });
drop.addEventListener("drop", (event) => choose(event.dataTransfer.files));
byId("scan").addEventListener("change", (event) => { choose([...event.target.files]); event.target.value = ""; });
byId("photos").addEventListener("change", (event) => { choosePhotos([...event.target.files]); event.target.value = ""; });
byId("add").addEventListener("click", () => byId("scan").click());
byId("draw").addEventListener("click", drawOutline);
byId("erase").addEventListener("click", () => { marks.outline = marks.cut = null; showMarks(); byId(canDraw() ? "draw" : "cut").focus(); });
byId("cut").addEventListener("click", cutScan);
byId("measure").addEventListener("click", markDistance);
byId("size").addEventListener("change", (event) => oneSize(event.target));
byId("form").addEventListener("submit", submit);
byId("cancel").addEventListener("click", leave);
byId("remove").addEventListener("click", leave);
byId("redraw").addEventListener("click", () => { again(); drawOutline(); });
byId("recut").addEventListener("click", () => { again(); cutScan(); });
for (const button of document.querySelectorAll(".again")) button.addEventListener("click", again);
for (const button of document.querySelectorAll(".another")) button.addEventListener("click", another);
addEventListener("hashchange", route);

const state = await watchPreparing();
if (state) {
  limits = state.limits;
  byId("version").textContent = `planish ${state.version}`;
  byId("limits").textContent = `At most ${limits.upload_mb} MB per page; results are kept for ${limits.keep_hours} hours.`;
}
await changed();
await route();
