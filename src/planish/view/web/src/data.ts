/** The JSON data of the page, as written by view/html_document.py. */

export interface PictureLayer {
  kind: "picture";
  name: string;
  title: string;
  description: string;
  withMargin: boolean;
}

export interface MapLayer {
  kind: "map";
  name: string;
  title: string;
  description: string;
  unit: string;
  low: number;
  high: number;
  rows: number;
  cols: number;
  values: string;
}

export type Layer = PictureLayer | MapLayer;

export interface EncodedAnimation {
  points: number;
  states: number;
  low: [number, number, number];
  step: [number, number, number];
  moves: string;
  faces: string;
  steps: number[];
  heights: number[];
}

export interface ViewData {
  /** Width and height of the page, and the margin that some images have around it [mm]. */
  size: [number, number];
  margin: number;
  /** Position of the split between two pages, from the left [mm]. */
  spine: number | null;
  layers: Layer[];
  colours: string;
  animation: EncodedAnimation;
}

/** Quantized points of the sheet in every state: x, y, z are low + step * code [mm]. */
export interface FallAnimation {
  states: Int16Array[];
  faces: Uint32Array;
  low: [number, number, number];
  step: [number, number, number];
  heights: number[];
}

export function readData(): ViewData {
  return JSON.parse(document.getElementById("data")!.textContent!) as ViewData;
}

/** Bytes of an array encoded by `encode_array` in html_document.py. */
export async function decodeArray(text: string): Promise<ArrayBuffer> {
  const characters = atob(text);
  const bytes = new Uint8Array(characters.length);
  for (let i = 0; i < bytes.length; i++) bytes[i] = characters.charCodeAt(i);
  return new Response(new Blob([bytes]).stream().pipeThrough(new DecompressionStream("gzip"))).arrayBuffer();
}

export async function decodeAnimation(encoded: EncodedAnimation): Promise<FallAnimation> {
  const [moves, faces] = await Promise.all([decodeArray(encoded.moves), decodeArray(encoded.faces)]);
  const all = new Int16Array(moves);
  const length = 3 * encoded.points;
  // States are stored as differences to the previous one; sums wrap around as the differences did.
  for (let i = length; i < all.length; i++) all[i] += all[i - length];
  const states = Array.from({ length: encoded.states }, (_, k) => all.subarray(k * length, (k + 1) * length));
  return { states, faces: new Uint32Array(faces), low: encoded.low, step: encoded.step, heights: encoded.heights };
}
