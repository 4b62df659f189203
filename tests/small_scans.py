"""Collections of small scans for the tests of batches."""

import json
import re
from concurrent.futures import Future
from hashlib import sha256

from planish.batch.row import VARYING_FIELDS
from planish.batch.task import run_task
from planish.gallery import sheet, virtual_scan
from planish.io import write_scan


def write_small_scan(folder, name="book", seed=0):
    folder.mkdir(parents=True)
    made = virtual_scan(sheet(name), points=2000, photo_px=(600, 450), noise_mm=0.05, rng=seed)
    write_scan(folder / "scan.obj", made.scan)


class SynchronousPool:
    """A pool that runs its tasks at once, in this thread."""

    def __init__(self, slots=1, memory=float("inf")):
        self.slots, self.memory = slots, memory
        self.done = []

    def submit(self, task):
        self.done.append(task.item.name)
        answer = Future()
        try:
            answer.set_result(run_task(task))
        except Exception as problem:
            answer.set_exception(problem)
        return answer

    def close(self):
        pass

    def kill(self):
        pass


def digests(out):
    """SHA-256 of every file of an output folder without .planish; times are ignored."""
    files = [path for path in out.rglob("*") if path.is_file() and ".planish" not in path.parts]
    return {str(path.relative_to(out)): sha256(_timeless(path)).hexdigest() for path in files}


def _timeless(path):
    data = path.read_bytes()
    if path.suffix == ".json":
        return json.dumps(_without_times(json.loads(data))).encode()
    if path.name == "summary.jsonl":
        return json.dumps([_without_times(json.loads(line)) for line in data.splitlines()]).encode()
    if path.name == "summary.csv":
        return re.sub(rb"(,[0-9.]*){3}\r\n", b"\r\n", data)
    if path.name == "summary.html":
        return re.sub(rb'data-label="Seconds"[^\n]*|<h1>.*?</h1>|<title>.*?</title>', b"", data)
    return data


def _without_times(value):
    if isinstance(value, dict):
        return {key: _without_times(v) for key, v in value.items() if key not in (*VARYING_FIELDS, "seconds_total")}
    return [_without_times(item) for item in value] if isinstance(value, list) else value
