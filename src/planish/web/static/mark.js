// Marking places on a photo: the outline of the sheet, or two places whose distance is known.

import { byId, element } from "./show.js";

const STEP = 1; // percent of the photo that an arrow key moves a corner
const START = { outline: [[8, 8], [92, 8], [92, 92], [8, 92]], distance: [[30, 50], [70, 50]] };
const WORDS = {
  outline: ["The sheet’s outline", "Drag the corners onto those of the sheet, and along a bent side set several: tap or click beside the line for one more. Arrow keys move a corner, Delete removes it."],
  distance: ["A distance on the sheet", "Drag the two points onto places whose distance along the paper you have measured, as far apart as possible; arrow keys move them."],
};
const MOST = 60;

const dialog = byId("mark");
const stage = byId("stage");
const photo = byId("mark-photo");
const [lines] = byId("lines").children;
const which = byId("mark-which").querySelector("select");
const distance = byId("mark-distance").querySelector("input");
let points = []; // percent of width and height
let kind = "outline";
let files = [];
let stored = false;
let finish = () => {};

/**
 * Let the user mark places; resolves to { file, width, height, points [px], distance }, or null if cancelled.
 * `asStored`: on the photo's pixels as they are stored, whatever its orientation says.
 */
export function mark(what, photos, { asStored = false, before = null } = {}) {
  kind = what;
  files = photos;
  stored = asStored;
  points = before?.percent ?? START[kind].map((point) => [...point]);
  [byId("mark-title").textContent, byId("mark-help").textContent] = WORDS[kind];
  byId("mark-distance").hidden = kind !== "distance";
  byId("mark-more").hidden = kind !== "outline";
  byId("mark-which").hidden = photos.length < 2;
  which.replaceChildren(...photos.map((file, k) => element("option", file.name, { value: k })));
  which.value = Math.max(0, photos.findIndex((file) => file.name === before?.file));
  if (before?.distance) distance.value = before.distance;
  problem("");
  show();
  draw();
  dialog.showModal();
  return new Promise((resolve) => { finish = resolve; });
}

function show() {
  URL.revokeObjectURL(photo.src);
  photo.style.imageOrientation = stored ? "none" : "from-image";
  photo.alt = `Photo ${files[which.value].name}`;
  photo.src = URL.createObjectURL(files[which.value]);
}

function draw() {
  lines.setAttribute("points", points.map(([x, y]) => `${x},${y}`).join(" "));
  for (const corner of stage.querySelectorAll("button")) corner.remove();
  points.forEach(([x, y], k) => {
    const corner = element("button", "", { type: "button", className: "corner" });
    corner.setAttribute("aria-label", `${kind === "outline" ? "Corner" : "Place"} ${k + 1}, at ${Math.round(x)} % from the left and ${Math.round(y)} % from the top`);
    corner.style.left = `${x}%`;
    corner.style.top = `${y}%`;
    corner.dataset.number = k;
    stage.append(corner);
  });
}

function focus(k) {
  stage.querySelector(`[data-number="${k}"]`)?.focus();
}

function percent(event) {
  const box = stage.getBoundingClientRect();
  const limit = (value) => Math.min(100, Math.max(0, value));
  return [limit((100 * (event.clientX - box.left)) / box.width), limit((100 * (event.clientY - box.top)) / box.height)];
}

/** Put a corner between the two neighbours that it lengthens the outline least between. */
function insert(place) {
  if (points.length >= MOST) return points.length - 1;
  const far = ([a, b], [c, d]) => Math.hypot(a - c, b - d);
  const longer = (k) => far(points[k], place) + far(place, points[(k + 1) % points.length]) - far(points[k], points[(k + 1) % points.length]);
  const best = points.reduce((least, _, k) => (longer(k) < longer(least) ? k : least), 0);
  points.splice(best + 1, 0, place);
  draw();
  return best + 1;
}

let dragged = null;
stage.addEventListener("pointerdown", (event) => {
  event.preventDefault();
  const corner = event.target.closest(".corner");
  if (!corner && kind !== "outline") return;
  dragged = corner ? Number(corner.dataset.number) : insert(percent(event));
  focus(dragged);
  stage.setPointerCapture(event.pointerId);
});
stage.addEventListener("pointermove", (event) => {
  if (dragged === null) return;
  points[dragged] = percent(event);
  draw();
});
for (const end of ["pointerup", "pointercancel"]) stage.addEventListener(end, () => { if (dragged !== null) focus(dragged); dragged = null; });
stage.addEventListener("keydown", (event) => {
  const k = Number(event.target.dataset.number);
  const move = { ArrowLeft: [-STEP, 0], ArrowRight: [STEP, 0], ArrowUp: [0, -STEP], ArrowDown: [0, STEP] }[event.key];
  if (move) {
    const size = event.shiftKey ? 0.2 : 1;
    points[k] = points[k].map((value, axis) => Math.min(100, Math.max(0, value + size * move[axis])));
  } else if (event.key === "Delete" && kind === "outline" && points.length > 3) points.splice(k, 1);
  else return;
  event.preventDefault();
  draw();
  focus(Math.min(k, points.length - 1));
});

function problem(sentence) {
  byId("mark-problem").textContent = sentence;
  byId("mark-problem").hidden = !sentence;
}

/** Width and height of the photo as it is shown: browsers give those of the upright one, even where it is shown as stored. */
function shownSize() {
  const size = [photo.naturalWidth, photo.naturalHeight];
  return photo.clientWidth > photo.clientHeight === size[0] > size[1] ? size : size.reverse();
}

function close(result) {
  dialog.close();
  URL.revokeObjectURL(photo.src);
  photo.removeAttribute("src");
  finish(result);
}

photo.addEventListener("error", () => photo.hasAttribute("src") && problem("This browser cannot show the photo. Save it as JPEG or PNG to draw on it."));
which.addEventListener("change", show);
byId("mark-more").addEventListener("click", () => { // in the middle of the longest side
  const k = points.reduce((most, _, j) => (side(j) > side(most) ? j : most), 0);
  const next = points[(k + 1) % points.length];
  focus(insert([(points[k][0] + next[0]) / 2, (points[k][1] + next[1]) / 2]));
});
const side = (k) => Math.hypot(...points[k].map((value, axis) => value - points[(k + 1) % points.length][axis]));
byId("mark-cancel").addEventListener("click", () => close(null));
dialog.addEventListener("cancel", (event) => { event.preventDefault(); close(null); });
byId("mark-done").addEventListener("click", () => {
  const [width, height] = shownSize();
  if (!width) return problem("There is no photo to draw on.");
  if (kind === "distance" && !(Number(distance.value) > 0)) return problem("Type the distance of the two places in millimetres.");
  const pixels = points.map(([x, y]) => [Math.round((x * (width - 1)) / 100), Math.round((y * (height - 1)) / 100)]);
  close({ file: files[which.value].name, width, height, points: pixels, percent: points, distance: distance.value });
});
