"""`planish view` and `--html`."""

import json
from dataclasses import asdict

import pytest

from planish.cli.main import run
from planish.io import write_scan
from planish.job.from_report import inputs_from_report
from planish.settings import BinarizeSettings, FlattenSettings, RestoreSettings, VerletSettings
from test_view import Document

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def folder(book_scan, tmp_path_factory):
    """A finished restoration as by `planish demo`: scan, report and outputs in one folder."""
    made = tmp_path_factory.mktemp("done")
    write_scan(made / "scan.obj", book_scan.scan)
    flags = ["--dpi", "100", "--points", "2000", "--rotate", "0", "--report", str(made / "report.json")]
    page, html = ["-o", str(made / "page.png")], ["--html", str(made / "page.html")]
    assert run(["restore", str(made / "scan.obj"), *page, *html, *flags]) == 0
    return made


def test_restore_writes_it(folder):
    document = Document((folder / "page.html").read_bytes())
    report = json.loads((folder / "report.json").read_text())
    assert document.data["size"] == [report["page"]["width_mm"], report["page"]["height_mm"]]
    assert "scan.obj" in document.text
    assert report["sources"]["scan.obj"] in document.text


@pytest.mark.parametrize("named", [".", "report.json"])
def test_a_finished_restoration_is_viewed_with_its_settings(folder, tmp_path, named):
    """Another dpi or orientation would give other images."""
    out = tmp_path / "look.html"
    assert run(["view", str(folder / named), "-o", str(out), "--no-open"]) == 0
    again, before = Document(out.read_bytes()), Document((folder / "page.html").read_bytes())
    assert again.data == before.data
    for name in ("warped", "restored", "unshaded", "binary"):
        assert (again.picture(name) == before.picture(name)).all()


def test_a_scan_is_restored_and_viewed(folder, tmp_path):
    for path in folder.glob("scan.*"):
        (tmp_path / path.name).write_bytes(path.read_bytes())
    assert run(["view", str(tmp_path / "scan.obj"), "--no-open", "-q"]) == 0
    assert Document((tmp_path / "scan.html").read_bytes()).data["layers"]


def test_the_browser_opens_the_file(folder, tmp_path, monkeypatch):
    opened = []
    monkeypatch.setattr("webbrowser.open", opened.append)
    page = folder / "page.html"
    assert run(["view", str(page), "--open"]) == 0
    assert opened == [page.as_uri()]
    for name in ("DISPLAY", "WAYLAND_DISPLAY"):
        monkeypatch.delenv(name, raising=False)
    monkeypatch.setattr("sys.platform", "linux")
    assert run(["view", str(page)]) == 0  # no display
    assert len(opened) == 1


def test_a_page_of_another_size_gives_a_warning(folder, tmp_path, capsys):
    for path in folder.glob("scan.*"):
        (tmp_path / path.name).write_bytes(path.read_bytes())
    report = json.loads((folder / "report.json").read_text())
    report["page"]["width_mm"] += 5
    (tmp_path / "report.json").write_text(json.dumps(report))
    assert run(["view", str(tmp_path), "--no-open"]) == 0
    assert "the page restored for this view is" in capsys.readouterr().err


def test_settings_come_back_from_their_json(folder, tmp_path):
    wanted = RestoreSettings(
        flatten=FlattenSettings(method="verlet", points=500, verlet=VerletSettings(rounds=7)),
        binarize=BinarizeSettings(binarize="sauvola", k=0.3),
        pages="auto",
    )
    report = json.loads((folder / "report.json").read_text())
    report["settings"] = json.loads(json.dumps(asdict(wanted)))
    report["settings"]["of_a_later_version"] = 1
    (tmp_path / "report.json").write_text(json.dumps(report))
    for path in folder.glob("scan.*"):
        (tmp_path / path.name).write_bytes(path.read_bytes())
    assert inputs_from_report(tmp_path).settings == wanted


def changed(report, **parts):
    return json.dumps({**report, **parts})


@pytest.mark.parametrize(
    ("spoil", "said"),
    [
        (lambda at, report: (at / "report.json").unlink(), "has no report.json"),
        (lambda at, report: (at / "report.json").write_text("[" * 100_000), "is not a report of planish"),
        (lambda at, report: (at / "report.json").write_text("[1, 2]"), "is not a report of planish"),
        (lambda at, report: (at / "report.json").write_text(changed(report, page={})), "not a complete report"),
        (
            lambda at, report: (at / "report.json").write_text(changed(report, sources={})),
            "does not list its source files",
        ),
        (
            lambda at, report: (at / "report.json").write_text(changed(report, settings={"pages": "7"})),
            "does not know: pages is '7'; expected 1 or 2 or auto",
        ),
        (
            lambda at, report: (at / "report.json").write_text(changed(report, settings={"render": {"dpi": "many"}})),
            "does not know: render.dpi is 'many'; expected a number or auto",
        ),
        (lambda at, report: (at / "scan.obj").unlink(), "which is not beside it"),
        (lambda at, report: (at / "scan.obj").write_text("v 0 0 0\n"), "has changed since report.json was written"),
    ],
)
def test_incomplete_restorations_are_refused(folder, tmp_path, capsys, spoil, said):
    report = json.loads((folder / "report.json").read_text())
    for path in [*folder.glob("scan.*"), folder / "report.json"]:
        (tmp_path / path.name).write_bytes(path.read_bytes())
    spoil(tmp_path, report)
    assert run(["view", str(tmp_path), "--no-open"]) == 3
    err = capsys.readouterr().err
    assert said in err
    assert err.count("\n") == 1
    assert not (tmp_path / "view.html").exists()


@pytest.mark.parametrize(("name", "said"), [("page.txt", "ends in .html"), ("no/such/page.html", "there is no folder")])
def test_the_output_is_checked_first(folder, tmp_path, capsys, name, said):
    page = ["-o", str(tmp_path / "page.png")]
    for command in (
        ["view", str(folder), "-o", str(tmp_path / name)],
        ["restore", str(folder / "scan.obj"), *page, "--html", str(tmp_path / name)],
    ):
        assert run(command) == 4
        assert said in capsys.readouterr().err
    assert not list(tmp_path.iterdir())


def test_an_existing_file_can_be_protected(folder, capsys):
    before = (folder / "page.html").read_bytes()
    assert run(["view", str(folder), "-o", str(folder / "page.html"), "--no-overwrite", "--no-open"]) == 4
    assert (folder / "page.html").read_bytes() == before
