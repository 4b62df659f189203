// A scan as points that can be turned, so that its sheet's outline can be drawn on it as seen from any side.

import { byId } from "./show.js";

const RADIANS_PER_VIEW = 3; // dragged across the whole view, it turns by nearly half a turn
const STEP = 0.1; // radians that an arrow key turns it by
const FILL = 0.94; // of the view
const HALF = Math.PI / 2;
const FROM = { above: [0, 0], below: [0, Math.PI], front: [0, -HALF], side: [HALF, -HALF] }; // around the normal, then tilted

const dialog = byId("turn");
const canvas = byId("turn-view");
let scan = null; // { points, colours, centre, step, start }
let rows = null; // right, down and into the view
let finish = () => {};

/** Let the user turn a scan; resolves to { file, view }, a picture of it and how it was made, or null if cancelled. */
export function turn(data) {
  const plain = (code) => Uint8Array.from(atob(code), (letter) => letter.charCodeAt(0));
  const whole = plain(data.points);
  const numbers = new DataView(whole.buffer);
  const points = Float32Array.from({ length: whole.length / 2 }, (_, k) => numbers.getInt16(2 * k, true));
  let far = 1;
  for (let k = 0; k < points.length; k += 3) far = Math.max(far, Math.hypot(points[k], points[k + 1], points[k + 2]));
  scan = { points, far, colours: plain(data.colours), centre: data.centre, step: data.step, start: [data.right, data.down, cross(data.right, data.down)] };
  viewFrom("above");
  dialog.showModal();
  draw();
  return new Promise((resolve) => { finish = resolve; });
}

const cross = (a, b) => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];

function viewFrom(where) {
  const [around, tilt] = FROM[where];
  rows = scan.start.map((row) => [...row]);
  rotate(0, 1, around);
  rotate(2, 1, tilt);
}

/** Turn the axes of the view in the plane of two of them. */
function rotate(i, j, angle) {
  const [c, s] = [Math.cos(angle), Math.sin(angle)];
  const [a, b] = [rows[i], rows[j]];
  rows[i] = a.map((value, k) => c * value + s * b[k]);
  rows[j] = b.map((value, k) => c * value - s * a[k]);
}

/** Pixels to one step of the points. */
const scale = () => (FILL * Math.min(canvas.width, canvas.height)) / 2 / scan.far;

function draw() {
  const { width, height } = canvas;
  const context = canvas.getContext("2d");
  const image = context.createImageData(width, height);
  const shown = new Uint32Array(image.data.buffer);
  const nearest = new Float32Array(width * height).fill(Infinity);
  const size = scale();
  const [right, down, into] = rows;
  const { points, colours } = scan;
  const dot = Math.max(2, Math.ceil((1.2 * Math.min(width, height)) / Math.sqrt(points.length / 3)));
  for (let k = 0; k < points.length; k += 3) {
    const [x, y, z] = [points[k], points[k + 1], points[k + 2]];
    const depth = into[0] * x + into[1] * y + into[2] * z;
    const col = Math.round(width / 2 + size * (right[0] * x + right[1] * y + right[2] * z) - dot / 2);
    const row = Math.round(height / 2 + size * (down[0] * x + down[1] * y + down[2] * z) - dot / 2);
    const colour = (255 << 24) | (colours[k + 2] << 16) | (colours[k + 1] << 8) | colours[k];
    for (let r = Math.max(0, row); r < Math.min(height, row + dot); r++) {
      for (let c = Math.max(0, col); c < Math.min(width, col + dot); c++) {
        const at = r * width + c;
        if (depth >= nearest[at]) continue;
        nearest[at] = depth;
        shown[at] = colour;
      }
    }
  }
  context.putImageData(image, 0, 0);
}

let waiting = false;
function redraw() {
  if (waiting) return;
  waiting = true;
  requestAnimationFrame(() => { waiting = false; draw(); });
}

/** The view as the service takes it: column and row [px] as four numbers times (x, y, z, 1) each. */
function view() {
  const size = scale() / scan.step;
  const middle = [canvas.width / 2 - 0.5, canvas.height / 2 - 0.5]; // pixel centres are at integers
  return rows.slice(0, 2).map((row, k) => {
    const along = row.map((value) => value * size);
    return [...along, middle[k] - along.reduce((sum, value, axis) => sum + value * scan.centre[axis], 0)].map((value) => Number(value.toPrecision(9)));
  });
}

let held = null;
canvas.addEventListener("pointerdown", (event) => { held = [event.clientX, event.clientY]; canvas.setPointerCapture(event.pointerId); });
canvas.addEventListener("pointermove", (event) => {
  if (!held) return;
  const angle = RADIANS_PER_VIEW / canvas.clientWidth;
  rotate(2, 0, (event.clientX - held[0]) * angle);
  rotate(2, 1, (event.clientY - held[1]) * angle);
  held = [event.clientX, event.clientY];
  redraw();
});
for (const end of ["pointerup", "pointercancel"]) canvas.addEventListener(end, () => { held = null; });
canvas.addEventListener("keydown", (event) => {
  const by = { ArrowLeft: [0, -STEP], ArrowRight: [0, STEP], ArrowUp: [1, -STEP], ArrowDown: [1, STEP] }[event.key];
  if (!by) return;
  event.preventDefault();
  rotate(2, ...by);
  redraw();
});
for (const button of dialog.querySelectorAll("[data-from]")) {
  button.addEventListener("click", () => { viewFrom(button.dataset.from); redraw(); });
}

function close(result) {
  dialog.close();
  finish(result);
}

byId("turn-cancel").addEventListener("click", () => close(null));
dialog.addEventListener("cancel", (event) => { event.preventDefault(); close(null); });
byId("turn-done").addEventListener("click", () => {
  draw();
  canvas.toBlob((picture) => close({ file: new File([picture], "scan.png", { type: "image/png" }), view: view() }));
});
