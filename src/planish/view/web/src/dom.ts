/** Elements of the page, by the names that page.html gives them. */

export function byId<T extends HTMLElement>(id: string): T {
  return document.getElementById(id) as T;
}

export function make<K extends keyof HTMLElementTagNameMap>(
  tag: K,
  className: string,
  text = "",
): HTMLElementTagNameMap[K] {
  const element = document.createElement(tag);
  element.className = className;
  element.textContent = text;
  return element;
}

export function fill(select: HTMLSelectElement, options: { name: string; title: string }[], chosen: string): void {
  select.replaceChildren(...options.map(({ name, title }) => new Option(title, name, false, name === chosen)));
}

/** A canvas made as large as it stands on the screen, with its pen in CSS pixels; null while it is not shown. */
export function pen(canvas: HTMLCanvasElement): CanvasRenderingContext2D | null {
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
