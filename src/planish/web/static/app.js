// The page: choose and upload files, then follow the job. The URL fragment holds the job id, so that a reload finds it.

import * as api from "./api.js";
import { byId, done, element, failed, sending, size, showSection, working } from "./show.js";

const KEPT = "planish.jobs";
const MOST_KEPT = 8;
let chosen = [];
let unsubscribe = () => {};
let upload = null;
let limits = null;

const named = () => new URLSearchParams(location.hash.slice(1)).get("job");

function choose(files) {
  for (const file of files) {
    chosen = chosen.filter((other) => other.name !== file.name);
    chosen.push(file);
  }
  showChosen();
}

/** Add photos: those taken just now are all called image.jpg on some phones, so they get numbers. */
function choosePhotos(files) {
  for (const file of files) {
    if (chosen.some((other) => other.size === file.size && other.lastModified === file.lastModified)) continue;
    const [, stem, suffix] = /^(.*?)(\.[^.]*)?$/.exec(file.name);
    let name = file.name;
    for (let k = 2; chosen.some((other) => other.name === name); k++) name = `${stem}-${k}${suffix ?? ""}`;
    chosen.push(new File([file], name, { type: file.type, lastModified: file.lastModified }));
  }
  showChosen();
}

function showChosen() {
  byId("chosen").replaceChildren(...chosen.map((file) => {
    const item = element("li");
    const drop = element("button", "Remove", { type: "button" });
    drop.append(element("span", ` ${file.name}`, { className: "unseen" }));
    drop.onclick = () => { chosen = chosen.filter((other) => other !== file); showChosen(); byId("scan").focus(); };
    item.append(element("span", file.name, { className: "what" }), element("span", size(file.size), { className: "much" }), drop);
    return item;
  }));
  refuse("");
}

function refuse(sentence) {
  byId("refused").textContent = sentence;
  byId("refused").hidden = !sentence;
}

async function submit(event) {
  event.preventDefault();
  if (!chosen.length) return refuse("Choose photos, or the files of a scan, first.");
  const form = new FormData(byId("form"));
  form.delete("scan");
  for (const [name, value] of [...form]) if (value === "") form.delete(name);
  for (const file of chosen) form.append("scan", file, file.name);
  const bytes = [...form.values()].reduce((sum, value) => sum + (value.size ?? 0), 0);
  if (limits && bytes > limits.upload_mb * 1e6) return refuse(`The files have ${size(bytes)}; the limit is ${limits.upload_mb} MB.`);
  refuse("");
  const title = chosen[0].name;
  upload = new AbortController();
  sending(title, 0);
  try {
    const job = await api.send(form, (share) => sending(title, share), upload.signal);
    chosen = [];
    showChosen();
    keep([{ id: job.id, title: job.title }, ...kept()].slice(0, MOST_KEPT));
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
    keep(kept().filter((other) => other.id !== id));
    failed("This page", "It no longer exists: results are deleted after a while.");
  } else if (job.state === "done") done(job);
  else if (job.state === "failed") failed(job.title, job.sentence);
  else working(job);
}

function start() {
  showSection("start");
  const jobs = kept();
  byId("recent").hidden = jobs.length === 0;
  byId("recent").querySelector("ul").replaceChildren(...jobs.map(({ id, title }) => {
    const item = element("li");
    item.append(element("a", title, { href: `#job=${id}` }));
    return item;
  }));
}

async function route() {
  unsubscribe();
  unsubscribe = () => {};
  const id = named();
  if (!id) return start();
  const job = await api.job(id);
  if (job === null || job.state === "done" || job.state === "failed") return show(job, id);
  unsubscribe = api.follow(id, (state) => show(state, id));
}

function kept() {
  try { return JSON.parse(localStorage.getItem(KEPT)) ?? []; } catch { return []; }
}

function keep(jobs) {
  try { localStorage.setItem(KEPT, JSON.stringify(jobs)); } catch { /* storage may be disabled in private windows */ }
}

async function leave() {
  if (upload) return upload.abort();
  const id = named();
  unsubscribe();
  await api.remove(id);
  keep(kept().filter((other) => other.id !== id));
  location.hash = "";
}

const drop = byId("drop");
for (const kind of ["dragenter", "dragover"]) drop.addEventListener(kind, (event) => { event.preventDefault(); drop.classList.add("over"); });
for (const kind of ["dragleave", "drop"]) drop.addEventListener(kind, (event) => { event.preventDefault(); drop.classList.remove("over"); });
drop.addEventListener("drop", (event) => choose(event.dataTransfer.files));
byId("scan").addEventListener("change", (event) => { choose(event.target.files); event.target.value = ""; });
byId("photos").addEventListener("change", (event) => { choosePhotos(event.target.files); event.target.value = ""; });
byId("form").addEventListener("submit", submit);
byId("cancel").addEventListener("click", leave);
byId("remove").addEventListener("click", leave);
for (const button of document.querySelectorAll(".again")) button.addEventListener("click", () => { location.hash = ""; if (!named()) start(); });
addEventListener("hashchange", route);

const state = await api.health();
if (state) {
  limits = state.limits;
  byId("version").textContent = `planish ${state.version}`;
  byId("limits").textContent = `At most ${limits.upload_mb} MB per page; results are kept for ${limits.keep_hours} hours.`;
}
await route();
