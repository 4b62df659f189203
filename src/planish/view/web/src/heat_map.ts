/** Heat maps of the page: colours, legend, and the value at a position. */

import { createElement } from "./dom";
import { decodeArray, type MapLayer } from "./data";

const UNKNOWN = 255;

export interface HeatMap {
  layer: MapLayer;
  picture: HTMLCanvasElement;
  /** A new legend element. */
  legend(): HTMLElement;
  /** Formatted value at a position, given as fractions of width and height of the page. */
  read(x: number, y: number): string | null;
}

export async function heatMap(layer: MapLayer, colours: Uint8Array): Promise<HeatMap> {
  const values = new Uint8Array(await decodeArray(layer.values));
  return {
    layer,
    picture: renderMap(values, layer.rows, layer.cols, colours),
    legend: () => legend(layer, colours),
    read(x, y) {
      const row = Math.floor(y * layer.rows);
      const col = Math.floor(x * layer.cols);
      if (row < 0 || col < 0 || row >= layer.rows || col >= layer.cols) return null;
      const value = values[row * layer.cols + col];
      return value === UNKNOWN ? null : formatValue(layer, value);
    },
  };
}

function formatValue(layer: MapLayer, code: number): string {
  const range = layer.high - layer.low;
  const value = layer.low + (range * code) / (UNKNOWN - 1);
  const decimals = Math.max(0, -Math.floor(Math.log10(range / 100)));
  const more = code === UNKNOWN - 1 ? " or more" : "";
  const unit = layer.title.endsWith(layer.unit) ? "" : ` ${layer.unit}`;
  return `${layer.title.toLowerCase()} ${value.toFixed(decimals)}${unit}${more}`;
}

function renderMap(values: Uint8Array, rows: number, cols: number, colours: Uint8Array): HTMLCanvasElement {
  const canvas = document.createElement("canvas");
  canvas.width = cols;
  canvas.height = rows;
  const image = new ImageData(cols, rows);
  for (let i = 0; i < values.length; i++) {
    const code = values[i];
    if (code === UNKNOWN) continue; // transparent
    image.data.set(colours.subarray(3 * code, 3 * code + 3), 4 * i);
    image.data[4 * i + 3] = 255;
  }
  canvas.getContext("2d")!.putImageData(image, 0, 0);
  return canvas;
}

function legend(layer: MapLayer, colours: Uint8Array): HTMLElement {
  const ramp = Uint8Array.from({ length: UNKNOWN }, (_, k) => k);
  const bar = renderMap(ramp, 1, UNKNOWN, colours);
  bar.className = "bar";
  bar.setAttribute("aria-hidden", "true");
  const middle = (layer.low + layer.high) / 2;
  const ticks = createElement("p", "ticks");
  const words = [layer.low, middle, layer.high].map((value) => String(Number(value.toPrecision(3))));
  ticks.append(...words.map((word, k) => createElement("span", "", k === 2 ? `${word} ${layer.unit} or more` : word)));
  const box = createElement("div", "legend");
  box.append(createElement("p", "legend-title", layer.title), bar, ticks, createElement("p", "small", layer.description));
  return box;
}
