"""The running service: jobs in worker processes, and recovery when a worker or the server is killed."""

import io
import os
import signal
import subprocess
import sys
import time
import zipfile

import pytest

from planish.gallery import sheet, virtual_scan
from planish.io import write_scan
from planish.job import Job, Outputs, run
from planish.settings import RenderSettings, RestoreSettings
from serve_process import PATIENCE, SLOW, Server, runs

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def scan(tmp_path_factory):
    """Files of a scan of a small card."""
    folder = tmp_path_factory.mktemp("scan")
    taken = virtual_scan(sheet("book", width_mm=74, height_mm=105), points=2000, photo_px=(600, 450)).scan
    write_scan(folder / "scan.obj", taken)
    return [folder / name for name in ("scan.obj", "scan.mtl", "scan.jpg")]


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return tmp_path_factory.mktemp("served")


@pytest.fixture(scope="module")
def server(folder):
    started = Server(folder)
    yield started
    if started.process.poll() is None:
        started.end(signal.SIGKILL)


@pytest.fixture(scope="module")
def finished(server, scan):
    """A job followed to its end, and its events."""
    job = server.send(scan)
    told = list(server.events(job))
    return job, told


def test_the_page_is_that_of_the_command_line(server, scan, finished, tmp_path):
    job, told = finished
    assert told[-1]["state"] == "done"
    assert told[-1]["settled"]
    outputs = Outputs(page=tmp_path / "page.png", binary=tmp_path / "page-bw.png", flat=tmp_path / "flat.obj")
    run(Job(scan=scan[0], outputs=outputs, settings=RestoreSettings(render=RenderSettings(dpi="auto"))))
    for path in (outputs.page, outputs.binary, outputs.flat):
        assert server.client.get(f"{job}/files/{path.name}").content == path.read_bytes()


def test_progress_follows_the_order_of_the_stages(finished):
    stages = list(dict.fromkeys(told["stage"] for told in finished[1] if told["stage"]))
    order = ["read", "clean", "flatten", "turn", "render", "unshade", "measure", "binarize", "write"]
    assert stages == [stage for stage in order if stage in stages]
    assert len(stages) >= 2  # short stages may end between two events


def test_files_can_be_downloaded_singly_and_as_zip(server, finished):
    job, told = finished
    archive = zipfile.ZipFile(io.BytesIO(server.client.get(told[-1]["all_files"]).content))
    assert archive.testzip() is None
    names = [file["name"] for file in told[-1]["files"]]
    assert archive.namelist() == names
    assert {"page.png", "page.tif", "page-bw.png", "flat.obj", "report.json", "preview.jpg"} <= set(names)
    for file in told[-1]["files"]:
        answer = server.client.get(file["href"])
        assert len(answer.content) == file["bytes"]
        assert archive.read(file["name"]) == answer.content
    assert server.client.get(f"{job}/files/jobs.sqlite").status_code == 404


def test_uploads_are_deleted_and_server_paths_not_revealed(server, folder, finished):
    job, told = finished
    assert [path.name for path in (folder / "jobs" / told[-1]["id"]).iterdir()] == ["out-1"]
    assert str(folder) not in server.client.get(f"{job}/files/report.json").text
    assert folder.stat().st_mode & 0o077 == 0


def test_an_invalid_scan_fails_with_a_sentence(server, tmp_path):
    (tmp_path / "scan.obj").write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 9\n")
    told = server.until(server.send([tmp_path / "scan.obj"]), lambda told: told["state"] == "failed")
    assert told["sentence"].startswith("scan.obj: face 0 uses point 8, but the file has 3 points")


def test_a_scan_cannot_read_files_of_the_server(server, scan, tmp_path):
    (tmp_path / "scan.obj").write_bytes(scan[0].read_bytes())
    (tmp_path / "scan.mtl").write_text(f"newmtl page\nmap_Kd {scan[2]}\n")
    job = server.send([tmp_path / "scan.obj", tmp_path / "scan.mtl"])
    told = server.until(job, lambda told: told["state"] == "failed")
    assert "which does not exist" in told["sentence"]


def test_a_killed_worker_affects_no_other_job_and_is_retried(server, scan):
    job = server.send(scan, **SLOW)
    os.kill(server.worker(job), signal.SIGKILL)
    told = server.until(job, lambda told: told["state"] in ("done", "failed"))
    assert told["state"] == "done"
    assert told["files"]


def test_a_job_can_be_cancelled_and_its_process_ends(server, scan, folder):
    job = server.send(scan, **SLOW)
    worker = server.worker(job)
    assert server.client.delete(job).status_code == 204
    assert server.client.get(job).status_code == 404
    deadline = time.monotonic() + PATIENCE
    while runs(worker) or (folder / job.replace("/api/", "")).exists():
        assert time.monotonic() < deadline
        time.sleep(0.05)


def test_the_description_is_openapi_and_has_every_setting(server):
    told = server.client.get("/api/openapi.json").json()
    assert told["openapi"].startswith("3.1")
    form = told["paths"]["/api/jobs"]["post"]["requestBody"]["content"]["multipart/form-data"]["schema"]
    assert {"scan", "dpi", "verlet.max-steps", "units", "formats"} <= set(form["properties"])


def test_a_second_server_on_the_same_port_or_folder_is_refused(server, folder, tmp_path):
    port = str(server.client.base_url.port)
    for flags, sentence in (
        (("--port", port, "--data", str(tmp_path)), f"port {port} is in use; give another with --port"),
        (("--port", "0", "--data", str(folder)), "is used by another server; give another folder with --data"),
    ):
        done = subprocess.run([sys.executable, "-m", "planish", "serve", *flags], capture_output=True, text=True)
        assert done.returncode == 4
        assert sentence in done.stderr
        assert done.stderr.count("\n") == 1


def test_other_machines_have_access_only_with_public():
    done = subprocess.run(
        [sys.executable, "-m", "planish", "serve", "--host", "0.0.0.0"], capture_output=True, text=True
    )
    assert done.returncode == 2
    assert "without login or encryption" in done.stderr


def test_without_its_extra_the_service_names_what_to_install():
    program = "import sys; sys.modules['fastapi'] = None; from planish.cli import main; main(['serve'])"
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True)
    assert done.returncode == 6
    assert done.stderr.startswith("planish: planish serve needs fastapi, which is not installed: pip install ")
    assert "uvicorn>=" in done.stderr


def test_nothing_is_lost_when_the_server_is_killed_or_stopped(server, scan, folder, finished):
    """Runs last because it ends the server."""
    done = server.client.get(finished[0]).json()
    running, waiting = server.send(scan, **SLOW), server.send(scan)
    worker = server.worker(running)
    server.end(signal.SIGKILL)
    second = Server(folder)
    try:
        assert second.client.get(finished[0]).json() == done
        assert second.client.get(done["files"][0]["href"]).status_code == 200
        for job in (running, waiting):
            assert second.until(job, lambda told: told["state"] in ("done", "failed"))["state"] == "done"
        assert not runs(worker)
        again = second.send(scan, **SLOW)
        worker = second.worker(again)
        assert second.end(signal.SIGTERM) == 0
    finally:
        second.process.kill()
    assert not runs(worker)
    third = Server(folder, "--keep-hours", "0.0001")
    try:
        assert third.client.get(again).json()["state"] in ("queued", "running")
        assert third.client.get(running).status_code == 404  # it had expired at the start
        assert third.end(signal.SIGINT) == 130
    finally:
        third.process.kill()
