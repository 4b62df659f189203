/** The 3D view of the sheet with three.js, rendered only when something has changed. */

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
import type { FallAnimation } from "./data";
import { clamp } from "./dom";

/** Surface of the sheet: an image with lighting, a map without lighting so that colours match its legend, or plain. */
export type Surface = { picture: HTMLImageElement } | { map: HTMLCanvasElement } | null;
export type Direction = "above" | "front" | "side";

export interface SceneView {
  /** Shows the sheet in a state; fractions interpolate between two. */
  show(position: number): void;
  setSurface(surface: Surface): void;
  viewFrom(direction: Direction): void;
  theme(): void;
}

const DIRECTIONS: Record<Direction | "start", [number, number]> = {
  // polar angle from the vertical and azimuth, in degrees
  start: [52, -24],
  above: [0.5, 0],
  front: [80, 0],
  side: [80, 90],
};
const PLAIN = new Color("#d9d3c6");
const BACK = new Color("#b3a089");

/** Nothing is rendered before the first call of `setSurface`. */
export function createScene(canvas: HTMLCanvasElement, animation: FallAnimation, size: [number, number]): SceneView {
  const renderer = new WebGLRenderer({ canvas, antialias: true, alpha: true, preserveDrawingBuffer: true });
  renderer.setPixelRatio(Math.min(window.devicePixelRatio, 2));
  renderer.shadowMap.enabled = true;
  renderer.shadowMap.autoUpdate = false;
  const scene = new Scene();
  const camera = new PerspectiveCamera(30, 1, 1, 10_000);
  camera.up.set(0, 0, 1);
  const controls = new OrbitControls(camera, canvas);
  canvas.style.touchAction = "pan-y"; // vertical swipes scroll the page
  controls.maxPolarAngle = 0.49 * Math.PI;
  controls.enableZoom = false;
  canvas.addEventListener("focus", () => (controls.enableZoom = true));
  canvas.addEventListener("blur", () => (controls.enableZoom = false));

  const radius = Math.hypot(...size, 2 * Math.max(...animation.heights)) / 2;
  const geometry = sheetGeometry(animation, size);
  const sheet = new Mesh<BufferGeometry, MeshBasicMaterial | MeshLambertMaterial>(geometry);
  const back = new Mesh(geometry, new MeshLambertMaterial({ color: BACK, side: BackSide }));
  sheet.castShadow = back.castShadow = true;
  const table = new Mesh(new PlaneGeometry(8 * radius, 8 * radius), new ShadowMaterial({ opacity: 0.28 }));
  table.position.z = -0.4; // slightly below the flat sheet
  table.receiveShadow = true;
  const grid = tableGrid(radius);
  scene.add(sheet, back, table, grid, new AmbientLight("white", 0.62 * Math.PI), lamp(radius));

  let hasSurface = false;
  let framePending = false;
  function draw(): void {
    if (framePending || !hasSurface) return;
    framePending = true;
    requestAnimationFrame(() => {
      framePending = false;
      renderer.render(scene, camera);
    });
  }

  function viewFrom(from: Direction | "start"): void {
    const [down, around] = DIRECTIONS[from].map((degrees) => (degrees * Math.PI) / 180);
    const half = Math.tan((camera.fov * Math.PI) / 360) * Math.min(1, camera.aspect);
    const away = (0.94 * radius) / half;
    controls.target.set(0, 0, from === "above" ? 0 : Math.max(...animation.heights) / 3);
    camera.position
      .set(Math.sin(down) * Math.sin(around), -Math.sin(down) * Math.cos(around), Math.cos(down))
      .multiplyScalar(away)
      .add(controls.target);
    camera.near = away / 50;
    camera.far = away * 10;
    camera.updateProjectionMatrix();
    controls.minDistance = radius / 10;
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
    if (hasSurface) renderer.render(scene, camera); // immediately, because resizing cleared the canvas
  }

  function theme(): void {
    (grid.material as LineBasicMaterial).color.set(getComputedStyle(canvas).color);
    draw();
  }

  function setSurface(surface: Surface): void {
    sheet.material.map?.dispose();
    sheet.material.dispose();
    hasSurface = true;
    if (surface === null) sheet.material = new MeshLambertMaterial({ color: PLAIN });
    else if ("picture" in surface) sheet.material = new MeshLambertMaterial({ map: texture(surface.picture, renderer) });
    else sheet.material = new MeshBasicMaterial({ map: texture(surface.map, renderer) });
    draw();
  }

  function show(position: number): void {
    updateGeometry(geometry, animation, position);
    renderer.shadowMap.needsUpdate = true;
    draw();
  }

  function orbit(around: number, down: number, closer = 1): void {
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
    const handlers: Record<string, () => void> = {
      ArrowLeft: () => orbit(-0.1, 0),
      ArrowRight: () => orbit(0.1, 0),
      ArrowUp: () => orbit(0, -0.1),
      ArrowDown: () => orbit(0, 0.1),
      "+": () => orbit(0, 0, 1.2),
      "=": () => orbit(0, 0, 1.2),
      "-": () => orbit(0, 0, 1 / 1.2),
      "0": () => viewFrom("start"),
    };
    const handler = event.ctrlKey || event.metaKey || event.altKey ? undefined : handlers[event.key];
    if (!handler) return;
    event.preventDefault();
    handler();
  });
  controls.addEventListener("change", draw);
  resize();
  viewFrom("start");
  show(0);
  new ResizeObserver(resize).observe(canvas);
  window.addEventListener("beforeprint", () => renderer.render(scene, camera));
  return { show, setSurface, viewFrom, theme };
}

/** Geometry of the sheet; texture coordinates are its positions on the page, that is in the last state. */
function sheetGeometry(animation: FallAnimation, size: [number, number]): BufferGeometry {
  const last = animation.states[animation.states.length - 1];
  const count = last.length / 3;
  const uv = new Float32Array(2 * count);
  for (let i = 0; i < count; i++) {
    for (let k = 0; k < 2; k++) uv[2 * i + k] = (animation.low[k] + animation.step[k] * last[3 * i + k]) / size[k] + 0.5;
  }
  const geometry = new BufferGeometry();
  geometry.setAttribute("position", new BufferAttribute(new Float32Array(3 * count), 3));
  geometry.setAttribute("uv", new BufferAttribute(uv, 2));
  geometry.setIndex(new BufferAttribute(animation.faces, 1));
  return geometry;
}

function updateGeometry(geometry: BufferGeometry, animation: FallAnimation, position: number): void {
  const at = clamp(position, 0, animation.states.length - 1);
  const from = animation.states[Math.floor(at)];
  const to = animation.states[Math.ceil(at)];
  const share = at - Math.floor(at);
  const places = geometry.getAttribute("position") as BufferAttribute;
  const out = places.array as Float32Array;
  for (let i = 0; i < out.length; i++) {
    const k = i % 3;
    out[i] = animation.low[k] + animation.step[k] * (from[i] + share * (to[i] - from[i]));
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

function lamp(radius: number): DirectionalLight {
  const light = new DirectionalLight("white", 0.48 * Math.PI);
  light.position.set(-1.1 * radius, 0.9 * radius, 2.2 * radius);
  light.castShadow = true;
  light.shadow.mapSize.set(1024, 1024);
  light.shadow.radius = 6;
  const view = light.shadow.camera;
  view.left = view.bottom = -1.4 * radius;
  view.right = view.top = 1.4 * radius;
  view.near = radius / 10;
  view.far = 6 * radius;
  return light;
}

/** Grid lines on the table, 10 mm apart; 50 mm for sheets larger than half a metre. */
function tableGrid(radius: number): GridHelper {
  const spacing = radius > 300 ? 50 : 10;
  const half = Math.ceil((1.25 * radius) / spacing);
  const grid = new GridHelper(2 * half * spacing, 2 * half, "white", "white");
  const material = grid.material as LineBasicMaterial;
  material.vertexColors = false;
  material.transparent = true;
  material.opacity = 0.55;
  material.depthWrite = false;
  grid.rotation.x = Math.PI / 2;
  grid.position.z = -0.5;
  return grid;
}
