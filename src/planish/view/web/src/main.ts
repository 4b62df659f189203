import { readData, decodeArray, decodeAnimation, type Layer } from "./data";
import { byId, fillSelect, createElement } from "./dom";
import { heatMap, type HeatMap } from "./heat_map";
import { animate } from "./animation";
import { createScene, type Surface, type Direction, type SceneView } from "./scene";
import { viewer } from "./viewer";

const data = readData();
const root = document.documentElement;

/** Images are elements of the page already; maps are rendered here. */
async function renderMaps(): Promise<Map<string, HeatMap>> {
  const colours = new Uint8Array(await decodeArray(data.colours));
  const maps = new Map<string, HeatMap>();
  for (const layer of data.layers) if (layer.kind === "map") maps.set(layer.name, await heatMap(layer, colours));
  return maps;
}

function elementOf(layer: Layer, maps: Map<string, HeatMap>): HTMLElement {
  const element = layer.kind === "picture" ? byId(`picture-${layer.name}`) : maps.get(layer.name)!.picture;
  element.classList.add("layer");
  element.classList.toggle("with-margin", layer.kind === "picture" && layer.withMargin);
  if (layer.kind === "map") {
    element.setAttribute("role", "img");
    element.setAttribute("aria-label", `Map: ${layer.description}`);
    byId("paper").append(element);
  }
  return element;
}

function showPage(maps: Map<string, HeatMap>): () => void {
  const inset = data.margin / (data.size[0] + 2 * data.margin);
  const insetY = data.margin / (data.size[1] + 2 * data.margin);
  byId("paper").style.setProperty("--inset-x", `${100 * inset}%`);
  byId("paper").style.setProperty("--inset-y", `${100 * insetY}%`);
  const elements = new Map(data.layers.map((layer) => [layer.name, elementOf(layer, maps)]));
  if (data.spine !== null) {
    const spine = createElement("div", "spine");
    spine.style.left = `${(100 * (data.margin + data.spine)) / (data.size[0] + 2 * data.margin)}%`;
    byId("paper").append(spine);
  }
  const reading = byId("reading");
  const empty = reading.textContent;
  const view = viewer(data, [...elements.values()], (at) => {
    if (!at) {
      reading.textContent = empty;
      return;
    }
    const values = [...maps.values()].map((map) => map.read(at[0] / data.size[0], at[1] / data.size[1]));
    const position = `${at[0].toFixed(1)} mm from the left, ${at[1].toFixed(1)} mm from the top`;
    reading.textContent = [position, ...values.filter((value) => value !== null)].join(" · ");
  });
  const [left, right] = [byId<HTMLSelectElement>("left"), byId<HTMLSelectElement>("right")];
  const names = data.layers.map((layer) => layer.name);
  const best = ["unshaded", "restored", names[names.length - 1]].find((name) => names.includes(name))!;
  fillSelect(left, data.layers, names[0]);
  fillSelect(right, data.layers, best);
  const choose = () => {
    const titles = new Map(data.layers.map((layer) => [layer.name, layer.title]));
    byId("left-label").textContent = titles.get(left.value)!;
    byId("right-label").textContent = titles.get(right.value)!;
    const legends = [left.value, right.value].map((name) => maps.get(name)?.legend());
    showLegends("page-legend", left.value === right.value ? legends.slice(1) : legends);
    view.show(elements.get(left.value)!, elements.get(right.value)!);
  };
  left.addEventListener("change", choose);
  right.addEventListener("change", choose);
  choose();
  return view.redraw;
}

function showLegends(id: string, legends: (HTMLElement | undefined)[]): void {
  byId(id).replaceChildren(...legends.filter((legend) => legend !== undefined));
}

async function showScene(maps: Map<string, HeatMap>): Promise<SceneView | null> {
  const animation = await decodeAnimation(data.animation);
  let view: SceneView;
  try {
    view = createScene(byId("space"), animation, data.size);
  } catch {
    byId("space").hidden = true;
    byId("no-space").hidden = false;
    for (const id of ["play", "step", "surface"]) byId<HTMLButtonElement>(id).disabled = true;
    return null;
  }
  const select = byId<HTMLSelectElement>("surface");
  const photo = document.getElementById("picture-restored") as HTMLImageElement | null;
  const choices = [...data.layers.filter((layer) => layer.kind === "map"), { name: "plain", title: "Plain" }];
  if (photo) choices.unshift({ name: "photo", title: "Page" });
  fillSelect(select, choices, photo ? "photo" : "plain");
  const choose = () => {
    const map = maps.get(select.value);
    const surface: Surface = map ? { map: map.picture } : select.value === "photo" ? { picture: photo! } : null;
    showLegends("space-legend", map ? [map.legend()] : []);
    view.setSurface(surface);
  };
  select.addEventListener("change", choose);
  for (const button of document.querySelectorAll<HTMLButtonElement>("[data-view]")) {
    button.addEventListener("click", () => view.viewFrom(button.dataset.view as Direction));
  }
  if (photo) await photo.decode();
  animate(animation, view);
  choose();
  return view;
}

function watchTheme(changed: () => void): void {
  const select = byId<HTMLSelectElement>("theme");
  select.addEventListener("change", () => {
    if (select.value) root.dataset.theme = select.value;
    else delete root.dataset.theme;
    changed();
  });
  window.matchMedia("(prefers-color-scheme: dark)").addEventListener("change", changed);
  changed();
}

async function main(): Promise<void> {
  const maps = await renderMaps();
  const redraw = showPage(maps);
  const sheet = await showScene(maps);
  watchTheme(() => {
    redraw();
    sheet?.theme();
  });
  root.dataset.ready = "";
}

void main();
