// The HTTP API, as this page uses it.

export class Refused extends Error {}

/** Send a form; `tell` hears the share that has gone out. */
export function send(form, tell, signal) {
  return new Promise((resolve, reject) => {
    const request = new XMLHttpRequest(); // fetch does not tell how much has been sent
    request.open("POST", "/api/jobs");
    request.responseType = "json";
    request.upload.onprogress = (event) => event.lengthComputable && tell(event.loaded / event.total);
    request.onload = () => (request.status === 201 ? resolve(request.response) : reject(refusal(request)));
    request.onerror = () => reject(new Refused("The service cannot be reached, or it ended the upload."));
    request.onabort = () => reject(new DOMException("", "AbortError"));
    signal.addEventListener("abort", () => request.abort());
    request.send(form);
  });
}

function refusal(request) {
  return new Refused(request.response?.detail ?? `The service answered ${request.status}.`);
}

/** The service's state and limits; null where it cannot be reached. */
export async function health() {
  const response = await fetch("/api/health").catch(() => null);
  return response?.ok ? response.json() : null;
}

export async function job(id) {
  const response = await fetch(`/api/jobs/${encodeURIComponent(id)}`);
  return response.ok ? response.json() : null;
}

export function remove(id) {
  return fetch(`/api/jobs/${encodeURIComponent(id)}`, { method: "DELETE" });
}

/** Follow a job: `tell` gets it whenever there is news, null when it is gone. Returns what ends that. */
export function follow(id, tell) {
  const source = new EventSource(`/api/jobs/${encodeURIComponent(id)}/events`);
  const end = () => source.close();
  source.onmessage = (event) => {
    const told = JSON.parse(event.data);
    if (told.state === "done" || told.state === "failed") end();
    tell(told);
  };
  source.addEventListener("removed", () => { end(); tell(null); });
  source.onerror = async () => { // reconnects by itself, but not after a 404
    if (source.readyState === EventSource.CLOSED && (await job(id)) === null) tell(null);
  };
  return end;
}
