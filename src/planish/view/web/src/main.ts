import { readData, unpack, unpackFall, type Layer } from "./data";
import { byId, fill, make } from "./dom";
import { heatMap, type HeatMap } from "./maps";
import { settle } from "./settle";
import { space, type Cover, type Look, type Space } from "./space";
import { viewer } from "./viewer";

const data = readData();
const root = document.documentElement;

/** The pictures stand in the page already; maps are painted here. */
async function paintMaps(): Promise<Map<string, HeatMap>> {
  const colours = new Uint8Array(await unpack(data.colours));
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
    element.setAttribute("aria-label", `Map: ${layer.said}`);
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
    const spine = make("div", "spine");
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
    const place = `${at[0].toFixed(1)} mm from the left, ${at[1].toFixed(1)} mm from the top`;
    reading.textContent = [place, ...values.filter((value) => value !== null)].join(" · ");
  });
  const [left, right] = [byId<HTMLSelectElement>("left"), byId<HTMLSelectElement>("right")];
  const names = data.layers.map((layer) => layer.name);
  const best = ["unshaded", "restored", names[names.length - 1]].find((name) => names.includes(name))!;
  fill(left, data.layers, names[0]);
  fill(right, data.layers, best);
  const choose = () => {
    const titles = new Map(data.layers.map((layer) => [layer.name, layer.title]));
    byId("left-said").textContent = titles.get(left.value)!;
    byId("right-said").textContent = titles.get(right.value)!;
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

async function showSpace(maps: Map<string, HeatMap>): Promise<Space | null> {
  const fall = await unpackFall(data.fall);
  let view: Space;
  try {
    view = space(byId("space"), fall, data.size);
  } catch {
    byId("space").hidden = true;
    byId("no-space").hidden = false;
    for (const id of ["play", "step", "surface"]) byId<HTMLButtonElement>(id).disabled = true;
    return null;
  }
  const select = byId<HTMLSelectElement>("surface");
  const photo = document.getElementById("picture-restored") as HTMLImageElement | null;
  const choices = [...data.layers.filter((layer) => layer.kind === "map"), { name: "plain", title: "Plain paper" }];
  if (photo) choices.unshift({ name: "photo", title: "Its photo" });
  fill(select, choices, photo ? "photo" : "plain");
  const choose = () => {
    const map = maps.get(select.value);
    const cover: Cover = map ? { map: map.picture } : select.value === "photo" ? { picture: photo! } : null;
    showLegends("space-legend", map ? [map.legend()] : []);
    view.cover(cover);
  };
  select.addEventListener("change", choose);
  for (const button of document.querySelectorAll<HTMLButtonElement>("[data-look]")) {
    button.addEventListener("click", () => view.look(button.dataset.look as Look));
  }
  if (photo) await photo.decode();
  settle(fall, view);
  choose();
  return view;
}

function themes(changed: () => void): void {
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
  const maps = await paintMaps();
  const redraw = showPage(maps);
  const sheet = await showSpace(maps);
  themes(() => {
    redraw();
    sheet?.theme();
  });
  root.dataset.ready = "";
}

void main();
