/** What planish put into the page: see view/document.py. */

export interface PictureLayer {
  kind: "picture";
  name: string;
  title: string;
  said: string;
  withMargin: boolean;
}

export interface MapLayer {
  kind: "map";
  name: string;
  title: string;
  said: string;
  unit: string;
  low: number;
  high: number;
  rows: number;
  cols: number;
  values: string;
}

export type Layer = PictureLayer | MapLayer;

export interface PackedFall {
  points: number;
  states: number;
  low: [number, number, number];
  step: [number, number, number];
  moves: string;
  faces: string;
  taken: number[];
  heights: number[];
}

export interface ViewData {
  /** Width and height of the page, and the margin that some pictures have around it [mm]. */
  size: [number, number];
  margin: number;
  /** Where two pages part, from the left [mm]. */
  spine: number | null;
  layers: Layer[];
  colours: string;
  fall: PackedFall;
}

/** The sheet in every state: x, y, z of each point as whole steps; places are low + step * code [mm]. */
export interface Fall {
  states: Int16Array[];
  faces: Uint32Array;
  low: [number, number, number];
  step: [number, number, number];
  heights: number[];
}

export function readData(): ViewData {
  return JSON.parse(document.getElementById("data")!.textContent!) as ViewData;
}

/** The bytes of what `packed` in document.py made. */
export async function unpack(text: string): Promise<ArrayBuffer> {
  const characters = atob(text);
  const bytes = new Uint8Array(characters.length);
  for (let i = 0; i < bytes.length; i++) bytes[i] = characters.charCodeAt(i);
  return new Response(new Blob([bytes]).stream().pipeThrough(new DecompressionStream("gzip"))).arrayBuffer();
}

export async function unpackFall(packed: PackedFall): Promise<Fall> {
  const [moves, faces] = await Promise.all([unpack(packed.moves), unpack(packed.faces)]);
  const all = new Int16Array(moves);
  const length = 3 * packed.points;
  // Every state is stored as the way from the one before; sums wrap around as the differences did.
  for (let i = length; i < all.length; i++) all[i] += all[i - length];
  const states = Array.from({ length: packed.states }, (_, k) => all.subarray(k * length, (k + 1) * length));
  return { states, faces: new Uint32Array(faces), low: packed.low, step: packed.step, heights: packed.heights };
}
