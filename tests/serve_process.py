"""`planish serve` as a process for tests, with an HTTP client."""

import json
import subprocess
import sys
from pathlib import Path

import httpx

PATIENCE = 240  # seconds, for a busy machine
FIELDS = {"dpi": "auto", "formats": "png,tif", "view": "false"}
SLOW = {"dpi": "400"}  # takes a second or two, so that a test can interfere


class Server:
    """`planish serve` in a folder, at a free port."""

    def __init__(self, folder, *flags):
        self.process = subprocess.Popen(
            [sys.executable, "-m", "planish", "serve", "--port", "0", "--data", str(folder), "--jobs", "1", *flags],
            stdout=subprocess.PIPE,
            text=True,
        )
        said = self.process.stdout.readline()
        self.client = httpx.Client(base_url=said.split()[-1], timeout=PATIENCE)

    def end(self, number):
        self.process.send_signal(number)
        code = self.process.wait(PATIENCE)
        self.process.stdout.close()
        self.client.close()
        return code

    def send(self, files, **fields):
        parts = [("scan", (path.name, path.read_bytes())) for path in files]
        answer = self.client.post("/api/jobs", files=parts, data={**FIELDS, **fields})
        assert answer.status_code == 201, answer.text
        return answer.headers["location"]

    def events(self, job):
        with self.client.stream("GET", f"{job}/events") as answer:
            assert answer.headers["content-type"].startswith("text/event-stream")
            yield from (json.loads(line[6:]) for line in answer.iter_lines() if line.startswith("data: "))

    def until(self, job, wanted):
        """Follow a job until a condition holds."""
        state = next((state for state in self.events(job) if wanted(state)), None)
        assert state is not None
        return state

    def worker(self, job):
        """Pid of the worker of a running job: a child of the fork server, which is a child of the server."""
        self.until(job, lambda state: state["state"] == "running" and state["stage"])
        found = [pid for child in children(self.process.pid) for pid in children(child)]
        assert len(found) == 1
        return found[0]


def children(pid):
    found = []
    for stat in Path("/proc").glob("[0-9]*/stat"):
        try:
            words = stat.read_text().rpartition(")")[2].split()
        except (FileNotFoundError, ProcessLookupError):
            continue
        if int(words[1]) == pid:
            found.append(int(stat.parent.name))
    return found


def runs(pid):
    try:
        return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0] != "Z"
    except FileNotFoundError:
        return False
