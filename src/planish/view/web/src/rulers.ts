/** Rulers in millimetres at the top and left of the page. */

import { context2d } from "./dom";

const STEPS = [0.1, 0.2, 0.5, 1, 2, 5, 10, 20, 50, 100, 200, 500, 1000];
const LABEL_PX = 46;
const TICK_PX = 4.5;

/** Draws ticks along one side: `zero` is the position of 0 mm, `scale` is CSS pixels per millimetre. */
export function drawRuler(canvas: HTMLCanvasElement, upright: boolean, zero: number, scale: number): void {
  const context = context2d(canvas);
  if (!context) return;
  const style = getComputedStyle(canvas);
  const length = upright ? canvas.clientHeight : canvas.clientWidth;
  const thick = upright ? canvas.clientWidth : canvas.clientHeight;
  const labelled = STEPS.find((step) => step * scale >= LABEL_PX) ?? STEPS[STEPS.length - 1];
  const parts = [10, 5, 4, 2].find((count) => (labelled * scale) / count >= TICK_PX && isRoundStep(labelled / count)) ?? 1;
  const step = labelled / parts;
  context.strokeStyle = context.fillStyle = style.color;
  context.font = `11px ${style.fontFamily}`;
  if (upright) {
    context.translate(0, length);
    context.rotate(-Math.PI / 2);
  }
  context.beginPath();
  for (let k = Math.ceil(-zero / scale / step); k * step * scale + zero <= length; k++) {
    const along = k * step * scale + zero;
    const at = Math.round(upright ? length - along : along) + 0.5;
    const major = k % parts === 0;
    const middle = parts % 2 === 0 && k % (parts / 2) === 0;
    context.moveTo(at, thick);
    context.lineTo(at, thick - (major ? 9 : middle ? 6 : 4));
    if (major) label(context, String(Number((k * step).toPrecision(6))), at, thick, length);
  }
  context.stroke();
}

function label(context: CanvasRenderingContext2D, text: string, at: number, thick: number, length: number): void {
  const half = context.measureText(text).width / 2;
  if (at - half < 0 || at + half > length) return;
  context.fillText(text, at - half, thick - 12);
}

/** Whether a tick spacing is a round number. */
function isRoundStep(step: number): boolean {
  return STEPS.some((known) => Math.abs(known - step) < 1e-9);
}
