/** The sheet in space: three.js, drawn only when something has changed. */

import {
  AmbientLight,
  BackSide,
  BufferAttribute,
  BufferGeometry,
  Color,
  DirectionalLight,
  GridHelper,
  LineBasicMaterial,
  Mesh,
  MeshBasicMaterial,
  MeshLambertMaterial,
  PerspectiveCamera,
  PlaneGeometry,
  Scene,
  ShadowMaterial,
  Spherical,
  SRGBColorSpace,
  Texture,
  Vector3,
  WebGLRenderer,
} from "three";
import { OrbitControls } from "three/addons/controls/OrbitControls.js";
import type { Fall } from "./data";
import { clamp } from "./dom";

/** What the sheet is covered with: a picture that the light falls on, a map whose colours must stay true, or nothing. */
export type Cover = { picture: HTMLImageElement } | { map: HTMLCanvasElement } | null;
export type Look = "above" | "front" | "side";

export interface Space {
  /** Shows the sheet in a state, or between two. */
  show(position: number): void;
  cover(cover: Cover): void;
  look(from: Look): void;
  theme(): void;
}

const LOOKS: Record<Look | "start", [number, number]> = {
  // degrees: down from the vertical, and around
  start: [52, -24],
  above: [0.5, 0],
  front: [80, 0],
  side: [80, 90],
};
const PLAIN = new Color("#d9d3c6");
const BACK = new Color("#b3a089");

/** Nothing is drawn before it has its first cover. */
export function space(canvas: HTMLCanvasElement, fall: Fall, size: [number, number]): Space {
  const renderer = new WebGLRenderer({ canvas, antialias: true, alpha: true, preserveDrawingBuffer: true });
  renderer.setPixelRatio(Math.min(window.devicePixelRatio, 2));
  renderer.shadowMap.enabled = true;
  renderer.shadowMap.autoUpdate = false;
  const scene = new Scene();
  const camera = new PerspectiveCamera(30, 1, 1, 10_000);
  camera.up.set(0, 0, 1);
  const controls = new OrbitControls(camera, canvas);
  canvas.style.touchAction = "pan-y"; // a finger that moves upwards scrolls the page
  controls.maxPolarAngle = 0.49 * Math.PI;
  controls.enableZoom = false;
  canvas.addEventListener("focus", () => (controls.enableZoom = true));
  canvas.addEventListener("blur", () => (controls.enableZoom = false));

  const reach = Math.hypot(...size, 2 * Math.max(...fall.heights)) / 2;
  const geometry = sheetGeometry(fall, size);
  const sheet = new Mesh<BufferGeometry, MeshBasicMaterial | MeshLambertMaterial>(geometry);
  const back = new Mesh(geometry, new MeshLambertMaterial({ color: BACK, side: BackSide }));
  sheet.castShadow = back.castShadow = true;
  const table = new Mesh(new PlaneGeometry(8 * reach, 8 * reach), new ShadowMaterial({ opacity: 0.28 }));
  table.position.z = -0.4; // below the sheet that lies on it
  table.receiveShadow = true;
  const grid = tableGrid(reach);
  scene.add(sheet, back, table, grid, new AmbientLight("white", 0.62 * Math.PI), lamp(reach));

  let covered = false;
  let waiting = false;
  function draw(): void {
    if (waiting || !covered) return;
    waiting = true;
    requestAnimationFrame(() => {
      waiting = false;
      renderer.render(scene, camera);
    });
  }

  function look(from: Look | "start"): void {
    const [down, around] = LOOKS[from].map((degrees) => (degrees * Math.PI) / 180);
    const half = Math.tan((camera.fov * Math.PI) / 360) * Math.min(1, camera.aspect);
    const away = (0.94 * reach) / half;
    controls.target.set(0, 0, from === "above" ? 0 : Math.max(...fall.heights) / 3);
    camera.position
      .set(Math.sin(down) * Math.sin(around), -Math.sin(down) * Math.cos(around), Math.cos(down))
      .multiplyScalar(away)
      .add(controls.target);
    camera.near = away / 50;
    camera.far = away * 10;
    camera.updateProjectionMatrix();
    controls.minDistance = reach / 10;
    controls.maxDistance = 4 * away;
    controls.update();
    draw();
  }

  let shown = [0, 0];
  function resize(): void {
    const { clientWidth: width, clientHeight: height } = canvas;
    if (!width || !height || (width === shown[0] && height === shown[1])) return;
    shown = [width, height];
    renderer.setSize(width, height, false);
    camera.aspect = width / height;
    camera.updateProjectionMatrix();
    if (covered) renderer.render(scene, camera); // now, as the canvas has just been emptied
  }

  function theme(): void {
    (grid.material as LineBasicMaterial).color.set(getComputedStyle(canvas).color);
    draw();
  }

  function cover(cover: Cover): void {
    sheet.material.map?.dispose();
    sheet.material.dispose();
    covered = true;
    if (cover === null) sheet.material = new MeshLambertMaterial({ color: PLAIN });
    else if ("picture" in cover) sheet.material = new MeshLambertMaterial({ map: texture(cover.picture, renderer) });
    else sheet.material = new MeshBasicMaterial({ map: texture(cover.map, renderer) });
    draw();
  }

  function show(position: number): void {
    place(geometry, fall, position);
    renderer.shadowMap.needsUpdate = true;
    draw();
  }

  function turn(around: number, down: number, closer = 1): void {
    const way = new Vector3().subVectors(camera.position, controls.target);
    const polar = new Spherical().setFromVector3(new Vector3(way.x, way.z, -way.y)); // three's polar axis is y
    polar.theta += around;
    polar.phi = clamp(polar.phi + down, 0.01, controls.maxPolarAngle);
    polar.radius = clamp(polar.radius / closer, controls.minDistance, controls.maxDistance);
    const turned = new Vector3().setFromSpherical(polar);
    camera.position.set(turned.x, -turned.z, turned.y).add(controls.target);
    controls.update();
    draw();
  }

  canvas.addEventListener("keydown", (event) => {
    const acts: Record<string, () => void> = {
      ArrowLeft: () => turn(-0.1, 0),
      ArrowRight: () => turn(0.1, 0),
      ArrowUp: () => turn(0, -0.1),
      ArrowDown: () => turn(0, 0.1),
      "+": () => turn(0, 0, 1.2),
      "=": () => turn(0, 0, 1.2),
      "-": () => turn(0, 0, 1 / 1.2),
      "0": () => look("start"),
    };
    const act = event.ctrlKey || event.metaKey || event.altKey ? undefined : acts[event.key];
    if (!act) return;
    event.preventDefault();
    act();
  });
  controls.addEventListener("change", draw);
  resize();
  look("start");
  show(0);
  new ResizeObserver(resize).observe(canvas);
  window.addEventListener("beforeprint", () => renderer.render(scene, camera));
  return { show, cover, look, theme };
}

/** The sheet with its texture coordinates: its places on the page, which its last state holds. */
function sheetGeometry(fall: Fall, size: [number, number]): BufferGeometry {
  const last = fall.states[fall.states.length - 1];
  const count = last.length / 3;
  const uv = new Float32Array(2 * count);
  for (let i = 0; i < count; i++) {
    for (let k = 0; k < 2; k++) uv[2 * i + k] = (fall.low[k] + fall.step[k] * last[3 * i + k]) / size[k] + 0.5;
  }
  const geometry = new BufferGeometry();
  geometry.setAttribute("position", new BufferAttribute(new Float32Array(3 * count), 3));
  geometry.setAttribute("uv", new BufferAttribute(uv, 2));
  geometry.setIndex(new BufferAttribute(fall.faces, 1));
  return geometry;
}

function place(geometry: BufferGeometry, fall: Fall, position: number): void {
  const at = clamp(position, 0, fall.states.length - 1);
  const from = fall.states[Math.floor(at)];
  const to = fall.states[Math.ceil(at)];
  const share = at - Math.floor(at);
  const places = geometry.getAttribute("position") as BufferAttribute;
  const out = places.array as Float32Array;
  for (let i = 0; i < out.length; i++) {
    const k = i % 3;
    out[i] = fall.low[k] + fall.step[k] * (from[i] + share * (to[i] - from[i]));
  }
  places.needsUpdate = true;
  geometry.computeVertexNormals();
  geometry.computeBoundingSphere();
}

function texture(source: HTMLImageElement | HTMLCanvasElement, renderer: WebGLRenderer): Texture {
  const made = new Texture(source);
  made.colorSpace = SRGBColorSpace;
  made.anisotropy = Math.min(4, renderer.capabilities.getMaxAnisotropy());
  made.needsUpdate = true;
  return made;
}

function lamp(reach: number): DirectionalLight {
  const light = new DirectionalLight("white", 0.48 * Math.PI);
  light.position.set(-1.1 * reach, 0.9 * reach, 2.2 * reach);
  light.castShadow = true;
  light.shadow.mapSize.set(1024, 1024);
  light.shadow.radius = 6;
  const view = light.shadow.camera;
  view.left = view.bottom = -1.4 * reach;
  view.right = view.top = 1.4 * reach;
  view.near = reach / 10;
  view.far = 6 * reach;
  return light;
}

/** Lines on the table, 10 mm apart; 50 mm on a sheet larger than half a metre. */
function tableGrid(reach: number): GridHelper {
  const apart = reach > 300 ? 50 : 10;
  const half = Math.ceil((1.25 * reach) / apart);
  const grid = new GridHelper(2 * half * apart, 2 * half, "white", "white");
  const material = grid.material as LineBasicMaterial;
  material.vertexColors = false;
  material.transparent = true;
  material.opacity = 0.55;
  material.depthWrite = false;
  grid.rotation.x = Math.PI / 2;
  grid.position.z = -0.5;
  return grid;
}
