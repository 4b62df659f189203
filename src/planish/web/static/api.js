// Client of the HTTP API.

export class Refused extends Error {}

/** Upload a form; `report` is called with the fraction that has been sent. */
export function send(form, report, signal) {
  return new Promise((resolve, reject) => {
    const request = new XMLHttpRequest(); // fetch has no upload progress
    request.open("POST", "/api/jobs");
    request.responseType = "json";
    request.upload.onprogress = (event) => event.lengthComputable && report(event.loaded / event.total);
    request.onload = () => (request.status === 201 ? resolve(request.response) : reject(refusal(request)));
    request.onerror = () => reject(new Refused("The service cannot be reached, or it ended the upload."));
    request.onabort = () => reject(new DOMException("", "AbortError"));
    signal.addEventListener("abort", () => request.abort());
    request.send(form);
  });
}

/** Points of a scan to look at, by a job of their own that is deleted again; `form` has the scan's files. */
export async function points(form) {
  form.set("points-only", "true");
  const { id } = await send(form, () => {}, new AbortController().signal);
  try {
    const ended = await new Promise((resolve) => {
      follow(id, (state) => { if (!state || ["done", "failed"].includes(state.state)) resolve(state); });
    });
    if (ended?.state !== "done") throw new Refused(ended?.sentence || "The scan could not be read.");
    return await (await fetch(ended.files[0].href)).json();
  } finally {
    remove(id);
  }
}

function refusal(request) {
  return new Refused(request.response?.detail ?? `The service answered ${request.status}.`);
}

/** State and limits of the service; null if it cannot be reached. */
export async function health() {
  const response = await fetch("/api/health").catch(() => null);
  return response?.ok ? response.json() : null;
}

/** A job; null if there is none any more, undefined if the service cannot be reached. */
export async function job(id) {
  const response = await fetch(`/api/jobs/${encodeURIComponent(id)}`).catch(() => undefined);
  if (!response) return undefined;
  return response.ok ? response.json() : null;
}

export function remove(id) {
  return fetch(`/api/jobs/${encodeURIComponent(id)}`, { method: "DELETE" });
}

/** Follow a job: `report` is called with it on every change, with null if it does not exist. Returns a function to stop. */
export function follow(id, report) {
  const source = new EventSource(`/api/jobs/${encodeURIComponent(id)}/events`);
  const end = () => source.close();
  source.onmessage = (event) => {
    const state = JSON.parse(event.data);
    if (state.state === "done" || state.state === "failed") end();
    report(state);
  };
  source.addEventListener("removed", () => { end(); report(null); });
  source.onerror = async () => { // reconnects by itself, but not after a 404
    if (source.readyState === EventSource.CLOSED && (await job(id)) === null) report(null);
  };
  return end;
}
