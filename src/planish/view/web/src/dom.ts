/** Helpers for elements of the page. */

export function byId<T extends HTMLElement>(id: string): T {
  return document.getElementById(id) as T;
}

export function createElement<K extends keyof HTMLElementTagNameMap>(
  tag: K,
  className: string,
  text = "",
): HTMLElementTagNameMap[K] {
  const element = document.createElement(tag);
  element.className = className;
  element.textContent = text;
  return element;
}

export function fillSelect(select: HTMLSelectElement, options: { name: string; title: string }[], chosen: string): void {
  select.replaceChildren(...options.map(({ name, title }) => new Option(title, name, false, name === chosen)));
}

/** 2D context in CSS pixels of a canvas resized to its displayed size; null if it is hidden. */
export function context2d(canvas: HTMLCanvasElement): CanvasRenderingContext2D | null {
  const { clientWidth: width, clientHeight: height } = canvas;
  if (!width || !height) return null;
  const ratio = window.devicePixelRatio;
  canvas.width = Math.round(width * ratio);
  canvas.height = Math.round(height * ratio);
  const context = canvas.getContext("2d")!;
  context.scale(ratio, ratio);
  return context;
}

export const clamp = (value: number, low: number, high: number): number => Math.min(Math.max(value, low), high);
