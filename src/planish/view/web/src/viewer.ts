/** The page viewer: two layers with a wipe between them, zoomed and panned together, with rulers. */

import { byId, clamp } from "./dom";
import { drawRuler } from "./rulers";

const MAX_ZOOM = 12;
const DIVIDER_GRAB_PX = 22;

export interface Viewer {
  show(left: Element, right: Element): void;
  redraw(): void;
}

export interface PageFrame {
  size: [number, number];
  margin: number;
  spine: number | null;
}

/** Calls `point` with the position of the pointer in mm, or null outside of the page. */
export function viewer(frame: PageFrame, layers: Element[], point: (at: [number, number] | null) => void): Viewer {
  const port = byId("window");
  const paper = byId("paper");
  const divider = byId("divider");
  const wipe = byId<HTMLInputElement>("wipe");
  const [width, height] = [frame.size[0] + 2 * frame.margin, frame.size[1] + 2 * frame.margin];
  let zoom = 1;
  let middle: [number, number] = [width / 2, height / 2]; // centre of the view, in mm from the corner of the margin
  let shown: [Element, Element] = [layers[0], layers[0]];

  const scale = () => zoom * Math.min(port.clientWidth / width, port.clientHeight / height);
  const origin = (): [number, number] => [
    port.clientWidth / 2 - middle[0] * scale(),
    port.clientHeight / 2 - middle[1] * scale(),
  ];

  function redraw(): void {
    const pixels = scale();
    const room = [port.clientWidth / pixels / 2, port.clientHeight / pixels / 2];
    middle = [width, height].map((side, k) =>
      room[k] * 2 >= side ? side / 2 : clamp(middle[k], room[k], side - room[k]),
    ) as [number, number];
    const [x, y] = origin();
    paper.style.width = `${width * pixels}px`;
    paper.style.height = `${height * pixels}px`;
    paper.style.transform = `translate(${x}px, ${y}px)`;
    const cut = (Number(wipe.value) / 100) * port.clientWidth;
    const share = clamp((cut - x) / (width * pixels), 0, 1);
    for (const layer of layers) {
      const isLeft = layer === shown[0];
      const isRight = layer === shown[1];
      layer.classList.toggle("shown", isLeft || isRight);
      if (isLeft !== isRight) clip(layer as HTMLElement, share, isLeft);
      else (layer as HTMLElement).style.clipPath = "";
    }
    divider.style.transform = `translateX(${cut}px)`;
    divider.hidden = shown[0] === shown[1];
    port.classList.toggle("zoomed", zoom > 1);
    drawRuler(byId("ruler-x"), false, x + frame.margin * pixels, pixels);
    drawRuler(byId("ruler-y"), true, y + frame.margin * pixels, pixels);
  }

  /** Clips a layer at a fraction of the frame; the layer may be the page without margin. */
  function clip(layer: HTMLElement, share: number, isLeft: boolean): void {
    const inset = layer.classList.contains("with-margin") ? 0 : frame.margin / width;
    const own = clamp((share - inset) / (1 - 2 * inset), 0, 1) * 100;
    layer.style.clipPath = isLeft ? `inset(0 ${100 - own}% 0 0)` : `inset(0 0 0 ${own}%)`;
  }

  function zoomBy(factor: number, x = port.clientWidth / 2, y = port.clientHeight / 2): void {
    const before = scale();
    zoom = clamp(zoom * factor, 1, MAX_ZOOM);
    const moved = 1 / before - 1 / scale();
    middle = [middle[0] + (x - port.clientWidth / 2) * moved, middle[1] + (y - port.clientHeight / 2) * moved];
    redraw();
  }

  function moveBy(dx: number, dy: number): void {
    middle = [middle[0] - dx / scale(), middle[1] - dy / scale()];
    redraw();
  }

  function wipeTo(x: number): void {
    wipe.value = String(Math.round((100 * x) / port.clientWidth));
    wipe.dispatchEvent(new Event("input"));
  }

  function placeAt(x: number, y: number): [number, number] | null {
    const [left, top] = origin();
    const at: [number, number] = [(x - left) / scale() - frame.margin, (y - top) / scale() - frame.margin];
    return at.every((value, k) => value >= 0 && value <= frame.size[k]) ? at : null;
  }

  handlePointers(port, { zoomBy, moveBy, wipeTo, cutAt: () => (Number(wipe.value) / 100) * port.clientWidth }, (at) =>
    point(at && placeAt(...at)),
  );
  port.addEventListener("keydown", (event) => {
    const step = 40;
    const handlers: Record<string, () => void> = {
      ArrowLeft: () => moveBy(step, 0),
      ArrowRight: () => moveBy(-step, 0),
      ArrowUp: () => moveBy(0, step),
      ArrowDown: () => moveBy(0, -step),
      "+": () => zoomBy(1.4),
      "=": () => zoomBy(1.4),
      "-": () => zoomBy(1 / 1.4),
      "0": () => zoomBy(1 / MAX_ZOOM),
    };
    const handler = event.ctrlKey || event.metaKey || event.altKey ? undefined : handlers[event.key];
    if (!handler) return;
    event.preventDefault();
    handler();
  });
  wipe.addEventListener("input", redraw);
  byId("closer").addEventListener("click", () => zoomBy(1.6));
  byId("farther").addEventListener("click", () => zoomBy(1 / 1.6));
  byId("whole").addEventListener("click", () => zoomBy(1 / MAX_ZOOM));
  new ResizeObserver(redraw).observe(port);

  return {
    show(left, right) {
      shown = [left, right];
      redraw();
    },
    redraw,
  };
}

interface PointerActions {
  zoomBy(factor: number, x: number, y: number): void;
  moveBy(dx: number, dy: number): void;
  wipeTo(x: number): void;
  cutAt(): number;
}

/** One finger or the mouse pans the page, or moves the divider if it starts there; two fingers or the wheel zoom. */
function handlePointers(port: HTMLElement, actions: PointerActions, point: (at: [number, number] | null) => void): void {
  const down = new Map<number, [number, number]>();
  let wiping = false;
  const local = (event: MouseEvent): [number, number] => {
    const box = port.getBoundingClientRect();
    return [event.clientX - box.left, event.clientY - box.top];
  };

  port.addEventListener("pointerdown", (event) => {
    const at = local(event);
    if (!down.size) wiping = Math.abs(at[0] - actions.cutAt()) < DIVIDER_GRAB_PX || !port.classList.contains("zoomed");
    down.set(event.pointerId, at);
    port.setPointerCapture(event.pointerId);
    point(at);
  });
  port.addEventListener("pointermove", (event) => {
    const at = local(event);
    const before = down.get(event.pointerId);
    if (!before) return point(at);
    const other = [...down].find(([id]) => id !== event.pointerId)?.[1];
    if (other) {
      const middle = [(at[0] + other[0]) / 2, (at[1] + other[1]) / 2];
      actions.zoomBy(distance(at, other) / Math.max(distance(before, other), 1), middle[0], middle[1]);
      actions.moveBy((at[0] - before[0]) / 2, (at[1] - before[1]) / 2);
    } else if (wiping) actions.wipeTo(clamp(at[0], 0, port.clientWidth));
    else actions.moveBy(at[0] - before[0], at[1] - before[1]);
    down.set(event.pointerId, at);
  });
  for (const name of ["pointerup", "pointercancel"] as const) {
    port.addEventListener(name, (event) => down.delete(event.pointerId));
  }
  port.addEventListener("pointerleave", () => point(null));
  port.addEventListener(
    "wheel",
    (event) => {
      // Without Ctrl the page scrolls, unless the viewer has the focus.
      if (!event.ctrlKey && document.activeElement !== port) return;
      event.preventDefault();
      actions.zoomBy(Math.exp(-event.deltaY / 300), ...local(event));
    },
    { passive: false },
  );
}

function distance(a: [number, number], b: [number, number]): number {
  return Math.hypot(a[0] - b[0], a[1] - b[1]);
}
