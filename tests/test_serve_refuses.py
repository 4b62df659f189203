"""Requests that the service refuses, and their messages; no job is started here."""

import asyncio
import io
import shutil
import zipfile
from pathlib import Path

import httpx
import pillow_heif
import pytest
from PIL import Image

import bad_uploads
from planish.errors import OutputError
from planish.settings import ServeSettings
from planish.system import others_may_enter
from planish.web.app import application
from planish.web.fields import read_fields
from planish.web.server import make_private_folder
from planish.web.service import Service
from planish.web.zip_stream import ZipResponse

LIMITS = ServeSettings(upload_mb=1, unpacked_mb=2, files=20, megapixels=100, queue=3)


@pytest.fixture
def service(tmp_path):
    made = Service(tmp_path, LIMITS)
    made.application = application(made)
    yield made
    made.store.close()


def ask(service, method, address, app=None, base="http://127.0.0.1:8008", **content):
    async def once():
        transport = httpx.ASGITransport(app or service.application)
        async with httpx.AsyncClient(transport=transport, base_url=base) as client:
            return await client.request(method, address, **content)

    return asyncio.run(once())


def assert_refused(answer, status, part):
    assert answer.status_code == status, answer.text
    assert answer.headers["content-type"] == "application/problem+json"
    told = answer.json()
    assert told["status"] == status
    assert part in told["detail"], told["detail"]
    assert "\n" not in told["detail"]
    assert len(told["detail"]) < 250


@pytest.mark.parametrize("name", bad_uploads.BAD)
def test_a_bad_upload_gets_a_sentence_and_leaves_nothing(service, tmp_path, name):
    files, fields, status, part = bad_uploads.BAD[name]
    if files is None:  # without files, httpx does not send multipart
        fields = {**fields, "units": "mm"}
        files = [("camera", ("c.json", b"{}"))]
    answer = ask(service, "POST", "/api/jobs", files=files, data=fields)
    assert_refused(answer, status, part)
    assert str(tmp_path) not in answer.text
    assert list((tmp_path / "jobs").iterdir()) == []
    assert service.store.all_ids() == set()


def test_the_unit_may_be_any_length():
    assert read_fields({"units": "7.91um"}).units == "7.91um"


def test_uploads_are_accepted_until_the_queue_is_full(service):
    in_a_folder = [(f"folder/{name}", data) for _, (name, data) in bad_uploads.GOOD]
    in_a_folder += [("folder/.DS_Store", b"x"), ("__MACOSX/folder/._scan.obj", b"x"), ("folder/notes.txt", b"x")]
    apart = {
        "scan": ("café scan.obj", bad_uploads.OBJ),
        "photo": ("p.png", bad_uploads.png()),
        "camera": ("c.json", b"{}"),
    }
    forms = [bad_uploads.GOOD, bad_uploads.one_zip(bad_uploads.zipped(*in_a_folder)), list(apart.items())]
    for place, files in enumerate(forms):
        answer = ask(service, "POST", "/api/jobs", files=files, data={"dpi": "auto", "verlet.max-steps": "7"})
        assert answer.status_code == 201, answer.text
        told = answer.json()
        assert (told["state"], told["ahead"]) == ("queued", place)
        assert answer.headers["location"] == f"/api/jobs/{told['id']}"
    full = ask(service, "POST", "/api/jobs", files=bad_uploads.GOOD)
    assert_refused(full, 429, "the queue is full (3 scans)")
    assert full.headers["retry-after"]
    assert ask(service, "DELETE", answer.headers["location"]).status_code == 204
    assert ask(service, "POST", "/api/jobs", files=bad_uploads.GOOD).status_code == 201


def test_what_an_image_holds_counts_and_not_how_its_name_ends(service, tmp_path):
    heic = io.BytesIO()
    pillow_heif.from_pillow(Image.new("RGB", (64, 48))).save(heic)
    for name, data in (("p.jpg", bad_uploads.png()), ("p.heic", bad_uploads.png()), ("p.jpg", heic.getvalue())):
        files = [("scan", ("scan.obj", bad_uploads.OBJ)), ("photo", (name, data))]
        answer = ask(service, "POST", "/api/jobs", files=files)
        assert answer.status_code == 201, answer.text
    assert ask(service, "DELETE", answer.headers["location"]).status_code == 204  # the queue holds three
    huge = [("scan", ("scan.obj", bad_uploads.OBJ)), ("photo", ("p.jpg", bad_uploads.png(100_000, 100_000)))]
    assert_refused(ask(service, "POST", "/api/jobs", files=huge), 413, "10000 megapixels")


FORM = "multipart/form-data; boundary=x"
PART = b"--x\r\nContent-Disposition: form-data; "


@pytest.mark.parametrize(
    ("content", "kind", "status", "part"),
    [
        (b"{}", "application/json", 415, "multipart/form-data"),
        (b"", "multipart/form-data", 415, "multipart/form-data"),
        (b"dpi=300", "application/x-www-form-urlencoded", 415, "multipart/form-data"),
        (b"hello", FORM, 422, "damaged"),
        (b"--x\r\n\r\nhello\r\n--x--", FORM, 422, "has no name"),
        (PART + b'name="dpi"\r\n\r\n300', FORM, 422, "cut short"),
        (PART + b'name="scan"; filename="scan\0.obj"\r\n\r\nv\r\n--x--', FORM, 422, "not a plain file name"),
        (PART + b'name="scan"; filename=""\r\n\r\n\r\n--x--', FORM, 422, "no scan was sent"),
        (b"", FORM, 422, "cut short"),
    ],
)
def test_invalid_forms_are_refused(service, content, kind, status, part):
    assert_refused(ask(service, "POST", "/api/jobs", content=content, headers={"content-type": kind}), status, part)


def test_a_declared_length_beyond_the_limit_is_refused_before_it_is_read(service):
    headers = {"content-type": "multipart/form-data; boundary=x", "content-length": "5000000000"}
    assert_refused(ask(service, "POST", "/api/jobs", content=b"", headers=headers), 413, "the limit of 1 MB")


def test_unknown_addresses_and_methods(service):
    assert_refused(ask(service, "GET", "/api/jobs/nothing"), 404, "no such job")
    assert_refused(ask(service, "DELETE", "/api/jobs/nothing"), 404, "no such job")
    assert_refused(ask(service, "GET", "/api/jobs/nothing/events"), 404, "no such job")
    assert_refused(ask(service, "GET", "/api/jobs/nothing/all.zip"), 404, "no such job")
    assert_refused(ask(service, "GET", "/api/jobs"), 405, "does not allow that method")
    assert ask(service, "PUT", "/api/jobs/nothing").headers["allow"] == "DELETE, GET"
    for path in ("/nothing", "/static/", "/static/../app.py", "/static/%2e%2e/app.py", "/jobs.sqlite"):
        assert_refused(ask(service, "GET", path), 404, "no such address")


def finished_job(service, names=("page.tif", "report.json")):
    """A job that is done, with files of some bytes."""
    here = ask(service, "POST", "/api/jobs", files=bad_uploads.GOOD).headers["location"]
    taken = service.store.take()
    folder = service.scheduler.results(taken)
    folder.mkdir()
    for name in names:
        (folder / name).write_bytes(b"flat" * 100_000)
    service.store.finish(taken.id, {"files": list(names), "settled": True, "outcome": "settled"})
    return here, folder


def test_head_is_answered_with_the_headers_of_get_and_nothing_else(service):
    here, _ = finished_job(service)
    addresses = ["/", "/static/app.js", "/api/health", "/api/openapi.json", "/api/card-a4.pdf", here, "/nothing"]
    for address in [*addresses, f"{here}/events", f"{here}/all.zip", f"{here}/files/page.tif"]:
        get, head = ask(service, "GET", address), ask(service, "HEAD", address)
        assert (head.status_code, head.content) == (get.status_code, b"")
        assert head.headers == get.headers
    waiting = ask(service, "POST", "/api/jobs", files=bad_uploads.GOOD).headers["location"]
    assert ask(service, "HEAD", f"{waiting}/events").status_code == 200  # its GET would not end
    assert ask(service, "HEAD", "/api/jobs").status_code == 405


def test_a_result_that_is_no_longer_on_the_disk_is_gone(service):
    here, folder = finished_job(service)
    (folder / "report.json").unlink()
    assert ask(service, "GET", f"{here}/files/page.tif").status_code == 200
    for address in (f"{here}/files/report.json", f"{here}/all.zip"):
        assert_refused(ask(service, "GET", address), 410, "report.json is no longer on the server's disk")
    shutil.rmtree(folder)
    assert_refused(ask(service, "GET", f"{here}/files/page.tif"), 410, "no longer on the server's disk")


def test_a_zip_is_whole_even_if_its_files_are_deleted_before_it_is_sent(service):
    _, folder = finished_job(service)
    names = ["page.tif", "report.json"]
    response = ZipResponse([folder / name for name in names], "a.zip")
    shutil.rmtree(folder)
    archive = zipfile.ZipFile(io.BytesIO(ask(service, "GET", "/", response).content))
    assert archive.testzip() is None
    assert archive.namelist() == names


@pytest.mark.skipif(not others_may_enter(Path("/")), reason="this system keeps permissions elsewhere")
def test_a_folder_of_jobs_is_made_private_or_refused(tmp_path):
    folder = tmp_path / "data"
    folder.mkdir(mode=0o755)
    (folder / "jobs.sqlite").touch()
    make_private_folder(folder)
    assert folder.stat().st_mode & 0o777 == 0o700
    folder.chmod(0o750)
    (folder / "letter.txt").touch()
    with pytest.raises(OutputError, match=r"other users may enter it, and it holds other files \(letter.txt\)"):
        make_private_folder(folder)
    assert folder.stat().st_mode & 0o777 == 0o750
    folder.chmod(0o700)
    make_private_folder(folder)


def test_results_before_the_end_are_a_conflict(service):
    here = ask(service, "POST", "/api/jobs", files=bad_uploads.GOOD).headers["location"]
    assert_refused(ask(service, "GET", f"{here}/files/page.png"), 409, "this job is queued")
    taken = service.store.take()
    service.store.fail(taken.id, "the sheet is a sphere")
    assert_refused(ask(service, "GET", f"{here}/all.zip"), 409, "the sheet is a sphere")


def test_unknown_hosts_and_cross_origin_requests_are_refused(service):
    for base in ("http://localhost:8008", "http://127.0.0.1:8008", "http://[::1]:8008", "http://192.168.1.7"):
        assert ask(service, "GET", "/api/health", base=base).status_code == 200
    named = "http://scans.example.org"
    assert_refused(ask(service, "GET", "/api/health", base=named), 421, "host name is not allowed")
    knowing = application(service, frozenset({"scans.example.org"}))
    assert ask(service, "GET", "/api/health", knowing, base=named).status_code == 200
    origins = ("http://evil.example", "null", "http://[", "http://[::1", "\u2100", "")
    for headers in (*({"origin": origin.encode()} for origin in origins), {"sec-fetch-site": "cross-site"}):
        answer = ask(service, "POST", "/api/jobs", files=bad_uploads.GOOD, headers=headers)
        assert_refused(answer, 403, "cross-origin")
    own = {"origin": "http://127.0.0.1:8008", "sec-fetch-site": "same-origin"}
    assert ask(service, "POST", "/api/jobs", files=bad_uploads.GOOD, headers=own).status_code == 201


def test_every_response_has_security_headers(service):
    for path in ("/", "/api/health", "/nothing", "/static/app.js"):
        headers = ask(service, "GET", path).headers
        assert "default-src 'none'" in headers["content-security-policy"]
        assert "unsafe" not in headers["content-security-policy"]
        assert headers["x-content-type-options"] == "nosniff"
        assert headers["referrer-policy"] == "no-referrer"


def test_a_service_that_shuts_down_refuses_jobs(service):
    service.begin_shutdown()
    assert_refused(ask(service, "POST", "/api/jobs", files=bad_uploads.GOOD), 503, "shutting down")
    assert ask(service, "GET", "/api/health").json()["status"] == "stopping"
