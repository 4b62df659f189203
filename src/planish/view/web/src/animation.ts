/** The slider and the play button of the animation. */

import { byId } from "./dom";
import type { FallAnimation } from "./data";
import type { SceneView } from "./scene";

const SECONDS = 4;

export function animate(animation: FallAnimation, view: SceneView): void {
  const slider = byId<HTMLInputElement>("step");
  const button = byId("play");
  const label = byId("step-label");
  const last = animation.states.length - 1;
  const reducedMotion = window.matchMedia("(prefers-reduced-motion: reduce)");
  let playing = false;
  slider.max = String(last);

  function show(position: number): void {
    const step = Math.round(position);
    slider.value = String(step);
    const high = `${animation.heights[step].toFixed(animation.heights[step] < 10 ? 1 : 0)} mm high`;
    slider.setAttribute("aria-valuetext", `step ${step} of ${last}, ${high}`);
    label.textContent = step === last ? "the page, flat" : step === 0 ? `the scan, ${high}` : `${step} of ${last}, ${high}`;
    view.show(position);
  }

  function stop(): void {
    playing = false;
    button.textContent = Number(slider.value) === last ? "Replay" : "Play";
  }

  function play(): void {
    const from = Number(slider.value) === last ? 0 : Number(slider.value);
    const start = performance.now();
    playing = true;
    button.textContent = "Pause";
    const frame = (now: number) => {
      if (!playing) return;
      const position = Math.min(from + ((now - start) / 1000 / SECONDS) * last, last);
      show(reducedMotion.matches ? Math.floor(position) : position);
      if (position < last) requestAnimationFrame(frame);
      else stop();
    };
    requestAnimationFrame(frame);
  }

  button.addEventListener("click", () => (playing ? stop() : play()));
  slider.addEventListener("input", () => {
    show(Number(slider.value));
    stop();
  });
  show(0);
}
