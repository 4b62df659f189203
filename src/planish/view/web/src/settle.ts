/** The slider that lets the sheet settle, and the button that plays it. */

import { byId } from "./dom";
import type { Fall } from "./data";
import type { Space } from "./space";

const SECONDS = 4;

export function settle(fall: Fall, space: Space): void {
  const slider = byId<HTMLInputElement>("step");
  const button = byId("play");
  const said = byId("step-said");
  const last = fall.states.length - 1;
  const calm = window.matchMedia("(prefers-reduced-motion: reduce)");
  let playing = false;
  slider.max = String(last);

  function show(position: number): void {
    const step = Math.round(position);
    slider.value = String(step);
    const high = `${fall.heights[step].toFixed(fall.heights[step] < 10 ? 1 : 0)} mm high`;
    slider.setAttribute("aria-valuetext", `step ${step} of ${last}, ${high}`);
    said.textContent = step === last ? "the page, flat" : step === 0 ? `the scan, ${high}` : `${step} of ${last}, ${high}`;
    space.show(position);
  }

  function stop(): void {
    playing = false;
    button.textContent = Number(slider.value) === last ? "Again" : "Settle";
  }

  function play(): void {
    const from = Number(slider.value) === last ? 0 : Number(slider.value);
    const start = performance.now();
    playing = true;
    button.textContent = "Pause";
    const frame = (now: number) => {
      if (!playing) return;
      const position = Math.min(from + ((now - start) / 1000 / SECONDS) * last, last);
      show(calm.matches ? Math.floor(position) : position);
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
