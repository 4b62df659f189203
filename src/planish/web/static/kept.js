// Pages of this browser, remembered for as long as the service keeps them.

const NAME = "planish.jobs";

export function kept() {
  try {
    const jobs = JSON.parse(localStorage.getItem(NAME)) ?? [];
    return jobs.filter(({ expires }) => !expires || new Date(expires) > new Date());
  } catch { return []; }
}

function keep(jobs) {
  try { localStorage.setItem(NAME, JSON.stringify(jobs)); } catch { /* storage may be disabled in private windows */ }
}

/** Remember a job, or what has become of it. */
export function remember({ id, title, created, expires, verdict, state }) {
  const jobs = kept();
  const known = jobs.findIndex((job) => job.id === id);
  const job = { id, title, created, expires, verdict, state };
  if (known < 0) jobs.unshift(job); else jobs[known] = job;
  keep(jobs);
}

export const forget = (id) => keep(kept().filter((job) => job.id !== id));
