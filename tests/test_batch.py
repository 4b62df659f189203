"""Batch: which items are restored again, handling of failures, and the state of the output folder at every moment.

The restorations are stood in for: each copies one real result.
"""

import errno
import fcntl
import json
import shutil
from dataclasses import replace

import pytest
from PIL import Image

from planish.batch import BatchOptions, Item, batch, find_items
from planish.batch.items import ScanList
from planish.batch.row import Row, worst_first
from planish.batch.summary import write_summary
from planish.errors import InputError, OutputError, UsageError, install_command
from planish.io import write_json
from planish.job import JobResult, run
from planish.job.worker import LimitError, WorkerDiedError
from planish.settings import BatchFiles, BinarizeSettings, RenderSettings, RestoreSettings
from planish.types import Diagnostic
from small_scans import SynchronousPool, digests, write_small_scan

OPTIONS = BatchOptions(settings=RestoreSettings(render=RenderSettings(dpi=30.0), rotate="0"))


@pytest.fixture(scope="module")
def real(tmp_path_factory):
    """One scan, restored."""
    at = tmp_path_factory.mktemp("real")
    write_small_scan(at / "in")
    (at / "out").mkdir()
    item = Item(name="a", scan=at / "in" / "scan.obj")
    return run(OPTIONS.make_job(item, at / "out", (), ())), at / "out"


@pytest.fixture
def restored(real, monkeypatch):
    """Replace `run`: scans that contain "bad" fail, all others give the same page. Lists the requested scans."""
    asked = []

    def stand_in(job, progress):
        text = job.scan.read_text()
        asked.append(job.scan.parent.name)
        if text.startswith("bad"):
            raise InputError(f"{job.scan} is bad")
        done, out = real
        report = replace(
            done.report,
            settled=not text.startswith("arched"),
            warnings=[Diagnostic("page-huge", "odd")] * text.startswith("odd"),
        )
        shutil.copy(out / "page.tif", job.outputs.page)
        write_json(job.outputs.report, report)
        return JobResult(report, [job.outputs.page, job.outputs.report])

    monkeypatch.setattr("planish.batch.task.run", stand_in)
    monkeypatch.setattr(
        "planish.batch.task.run_in_subprocess", lambda function, task, limits, stop: function(task, None)
    )
    return asked


@pytest.fixture
def folder(tmp_path):
    for name, text in {"a": "good", "b": "bad", "c": "good", "d": "odd", "e": "arched"}.items():
        (tmp_path / "in" / name).mkdir(parents=True)
        (tmp_path / "in" / name / "scan.obj").write_text(text)
    return tmp_path


def restore_all(folder, **how):
    how = {"options": OPTIONS, **how}
    return batch(find_items(folder / "in"), folder / "out", SynchronousPool, how.pop("options"), **how)


@pytest.mark.slow
def test_every_item_has_its_own_folder_and_rows_are_sorted_worst_first(folder, restored):
    calls = []
    counts = restore_all(folder, progress=lambda row, count, now: calls.append((row.name, count, now)))
    assert (counts.items, counts.failed, counts.not_good, counts.to_look_at, counts.done_now) == (5, 1, 1, 1, 5)
    assert calls == [(name, k, k) for k, name in enumerate("abcde", 1)]
    good = {"item.json", "page.tif", "preview.jpg", "report.json"}
    for name in "abcde":
        assert {path.name for path in (folder / "out" / name).iterdir()} == ({"item.json"} if name == "b" else good)
    rows = [json.loads(line) for line in (folder / "out" / "summary.jsonl").read_text().splitlines()]
    assert [row["name"] for row in rows] == ["b", "e", "d", "a", "c"]
    assert rows[0]["sentence"].endswith("scan.obj is bad")
    with Image.open(folder / "out" / "a" / "preview.jpg") as image:
        assert max(image.size) <= 480
    assert not list((folder / "out" / ".planish" / "work").iterdir())


def test_a_second_run_does_nothing(folder, restored):
    restore_all(folder)
    before = digests(folder / "out")
    restored.clear()
    assert restore_all(folder).done_now == 0
    assert restored == []
    assert digests(folder / "out") == before


def test_only_changed_items_are_restored_again(folder, restored):
    restore_all(folder)
    restored.clear()
    (folder / "in" / "b" / "scan.obj").write_text("mended")
    (folder / "in" / "c" / "scan.obj").write_text("bad now")
    (folder / "in" / "a" / "scan.obj").touch()
    calls = []
    counts = restore_all(folder, progress=lambda row, count, now: calls.append((row.name, count, now)))
    assert restored == ["b", "c"]
    assert counts.done_now == 2
    assert [(name, now) for name, _, now in calls] == [("d", 0), ("e", 0), ("a", 1), ("b", 2), ("c", 3)]  # a was read
    assert (folder / "out" / "b" / "page.tif").exists()
    assert not (folder / "out" / "c" / "page.tif").exists()  # no outdated page is left


def test_moved_scans_are_not_restored_again(folder, restored):
    restore_all(folder)
    restored.clear()
    shutil.copytree(folder / "in", folder / "elsewhere")
    shutil.rmtree(folder / "in")
    (folder / "elsewhere").rename(folder / "in")
    restore_all(folder)
    assert restored == []


@pytest.mark.parametrize(
    "other",
    [
        replace(OPTIONS, settings=replace(OPTIONS.settings, render=RenderSettings(dpi=31.0))),
        replace(OPTIONS, files=BatchFiles(mask=True)),
    ],
)
def test_other_settings_restore_everything_again(folder, restored, other):
    restore_all(folder)
    restored.clear()
    restore_all(folder, options=other)
    assert restored == list("abcde")


def test_failed_items_are_retried_only_on_request(folder, restored):
    restore_all(folder)
    restored.clear()
    restore_all(folder)
    restore_all(folder, retry=True)
    assert restored == ["b"]


def test_a_killed_process_gets_a_second_try_and_another_in_the_next_run(folder, restored, monkeypatch):
    deaths = {"a": 1, "c": 2}

    def killed_worker(function, task, limits, stop):
        if deaths.get(task.item.name, 0):
            deaths[task.item.name] -= 1
            raise WorkerDiedError("the process was killed")
        if task.item.name == "d":
            raise LimitError("it took too long")
        return function(task, None)

    monkeypatch.setattr("planish.batch.task.run_in_subprocess", killed_worker)
    counts = restore_all(folder)
    assert counts.failed == 3
    assert (folder / "out" / "a" / "page.tif").exists()
    restored.clear()
    restore_all(folder)
    assert restored == ["c"]  # not d, which would exceed the time limit again


def test_a_deleted_file_is_written_again(folder, restored):
    restore_all(folder)
    restored.clear()
    (folder / "out" / "c" / "page.tif").unlink()
    restore_all(folder)
    assert restored == ["c"]
    assert (folder / "out" / "c" / "page.tif").exists()


@pytest.mark.parametrize("left", [0, 1, 100, -1, -20])
def test_a_truncated_journal_costs_no_work(folder, restored, left):
    restore_all(folder)
    before = digests(folder / "out")
    restored.clear()
    journal = folder / "out" / ".planish" / "journal.jsonl"
    journal.write_bytes(journal.read_bytes()[:left])
    assert restore_all(folder).done_now == 0
    assert restored == []
    assert digests(folder / "out") == before
    assert len(journal.read_bytes().splitlines()) == 5


def test_a_run_killed_between_publishing_and_recording_can_be_resumed(folder, restored, monkeypatch):
    def killed(self, entry):
        raise KeyboardInterrupt

    with monkeypatch.context() as patch:
        patch.setattr("planish.batch.journal.Journal.add", killed)
        with pytest.raises(KeyboardInterrupt):
            restore_all(folder)
    assert restored == ["a"]
    restore_all(folder)
    assert restored == list("abcde")


def test_unfinished_items_of_an_earlier_run_are_removed(folder, restored):
    left = folder / "out" / ".planish" / "work" / "1234"
    left.mkdir(parents=True)
    (left / "page.tif").write_text("half")
    restore_all(folder)
    assert not left.exists()


# Errors that end a run


def test_a_full_disk_ends_the_run_and_fails_no_scan(folder, restored, monkeypatch):
    def full(job, progress):
        raise OutputError("there is no room left") from OSError(errno.ENOSPC, "No space left on device")

    with monkeypatch.context() as patch:
        patch.setattr("planish.batch.task.run", full)
        with pytest.raises(OutputError, match="no room left"):
            restore_all(folder)
    assert not (folder / "out" / "a").exists()
    assert restore_all(folder).done_now == 5


def test_a_page_too_large_for_its_format_fails_the_scan(folder, restored, monkeypatch):
    def too_large(job, progress):
        raise OutputError("a JPEG has at most 65500 pixels a side")

    monkeypatch.setattr("planish.batch.task.run", too_large)
    assert restore_all(folder).failed == 5


def test_two_runs_into_one_folder_are_refused(folder, restored):
    restore_all(folder)
    with (folder / "out" / ".planish" / "lock").open("a") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        with pytest.raises(OutputError, match=r"is in use by another planish batch \(process \d+ on "):
            restore_all(folder)
    restore_all(folder)


def test_foreign_files_are_not_touched(folder, restored):
    (folder / "out" / "c").mkdir(parents=True)
    (folder / "out" / "c" / "mine.txt").write_text("mine")
    with pytest.raises(OutputError, match="exists and was not made by planish batch"):
        restore_all(folder)
    assert restored == []
    assert (folder / "out" / "c" / "mine.txt").read_text() == "mine"


def test_names_that_differ_in_case_alone_are_refused_where_the_file_system_ignores_it(folder, restored, monkeypatch):
    (folder / "in" / "a").rename(folder / "in" / "C")
    assert restore_all(folder).items == 5  # here the file system tells A from a
    monkeypatch.setattr("planish.batch.output_dir._ignores_case", lambda _folder: True)
    with pytest.raises(OutputError, match="takes A for a, and the scans' names hold c in both ways"):
        restore_all(folder)
    (folder / "in" / "C").rename(folder / "in" / "a")
    assert restore_all(folder).items == 5


@pytest.mark.parametrize("out", ["in", "in/out", "."])
def test_scans_and_output_may_not_overlap(folder, out):
    with pytest.raises(OutputError, match="overlap; choose an output folder"):
        batch(find_items(folder / "in"), folder / out, SynchronousPool, OPTIONS)


def test_an_output_that_is_a_file_is_refused(folder):
    (folder / "out").write_text("")
    with pytest.raises(OutputError, match="a file stands there"):
        restore_all(folder)


def test_contradictory_options_are_refused_before_work(folder, restored):
    with pytest.raises(UsageError, match="PDF/A requires a PDF"):
        restore_all(folder, options=replace(OPTIONS, pdfa=True))
    settings = replace(OPTIONS.settings, binarize=BinarizeSettings(binarize="none"))
    with pytest.raises(UsageError, match="binarization method is none; name a method with binarize"):
        restore_all(folder, options=BatchOptions(settings=settings, files=BatchFiles(binary=True)))
    assert restored == []


# Memory limits concurrency


def test_no_more_tasks_run_at_once_than_fit_into_memory(folder, restored, monkeypatch):
    monkeypatch.setattr("planish.batch.run.estimate_memory", lambda item: 100 if item.name == "c" else 30)
    most = []

    class Counting(SynchronousPool):
        """Finishes its tasks only in `wait`."""

        def submit(self, task):
            under_way.append(task.item.name)
            return super().submit(task)

    under_way = []

    def wait(futures, return_when):
        most.append(list(under_way))
        under_way.pop(0)
        return {next(iter(futures))}, None

    monkeypatch.setattr("planish.batch.run.wait", wait)
    batch(find_items(folder / "in"), folder / "out", lambda: Counting(slots=4, memory=90), OPTIONS)
    assert most == [["a", "b"], ["b"], ["c"], ["d", "e"], ["e"]]


# The summary


def test_the_summary_escapes_html_and_formulas(tmp_path):
    rows = [
        Row(name="<b>&", status="failed", sentence="it has <script>alert(1)</script> in it"),
        Row(
            name="a b/c#1",
            status="look at it",
            warnings=['say "so"', "and so"],
            files=["page.tif"],
            strain_rms=float("inf"),
        ),
    ]
    write_summary(tmp_path, rows, ["<note>"])
    html = (tmp_path / "summary.html").read_text()
    assert "<script>alert" not in html
    assert "&lt;note&gt;" in html
    assert 'href="a%20b/c%231/page.tif"' in html
    assert "http" not in html
    assert "say &quot;so&quot; | and so" not in html
    assert '"say ""so"" | and so"' in (tmp_path / "summary.csv").read_text()
    lines = [json.loads(line) for line in (tmp_path / "summary.jsonl").read_text().splitlines()]
    assert lines[1]["strain_rms"] is None


def test_a_long_summary_is_limited_to_the_worst(tmp_path, monkeypatch):
    monkeypatch.setattr("planish.batch.summary.MAX_ROWS", 2)
    rows = [Row(name=f"scan-{k}", status="good", expected_error_mm=float(k)) for k in range(5)]
    write_summary(tmp_path, rows, [])
    html = (tmp_path / "summary.html").read_text()
    assert "scan-4" in html
    assert "scan-1" not in html
    assert "The worst 2 are shown" in html
    assert len((tmp_path / "summary.csv").read_text().splitlines()) == 6


def test_worst_first_by_status_then_by_error():
    rows = [Row(name=n, status=s, expected_error_mm=e) for n, s, e in [("a", "good", 3.0), ("b", "good", 4.0)]]
    rows += [Row(name="c", status="not good", expected_error_mm=1.0), Row(name="d", status="failed")]
    assert [row.name for row in worst_first(rows)] == ["d", "c", "b", "a"]


def test_a_list_may_have_its_output_anywhere(folder, restored):
    found = ScanList(find_items(folder / "in").items)
    assert batch(found, folder / "in" / "out", SynchronousPool, OPTIONS).items == 5


# The command


def command(folder, *flags):
    from planish.cli.main import run

    return run(["batch", str(folder / "in"), "-o", str(folder / "out"), *flags])


def test_the_exit_code_is_that_of_the_worst_item(folder, restored, capsys):
    assert command(folder) == 3
    said = capsys.readouterr()
    assert said.out == ""
    assert said.err.splitlines() == [
        f"planish: of 5 pages 1 not good, 1 to look at; {folder}/out/summary.html says why",
        f"planish: 1 of 5 scans failed; {folder}/out/summary.html lists the reasons, worst first",
    ]
    shutil.rmtree(folder / "in" / "b")
    assert command(folder) == 5
    shutil.rmtree(folder / "in" / "e")
    capsys.readouterr()
    assert command(folder, "--quiet") == 0
    said = capsys.readouterr()
    assert said.out == ""
    assert said.err == f"planish: of 3 pages 1 to look at; {folder}/out/summary.html says why\n"


def test_console_output(folder, restored, capsys):
    command(folder, "--verbose", "--jobs", "1")
    lines = capsys.readouterr().out.splitlines()
    assert lines[0].startswith("a\tgood\t")
    assert lines[1].startswith("b\tfailed\t")
    assert lines[-2:] == [
        "5 scans: 2 good, 1 to look at, 1 not good, 1 failed; 5 done now",
        f"written  {folder}/out/summary.html",
    ]


@pytest.mark.parametrize(
    ("flags", "code", "sentence"),
    [
        (["--jobs", "0"], 2, "--jobs must be at least 1"),
        (["--jobs", "2", "--dask", "tcp://localhost:1"], 2, "give only one of them"),
        (["--timeout", "0"], 2, "--timeout must be greater than 0"),
        (["--dask", "nowhere"], 3, "no Dask scheduler answers at nowhere"),
        (["--pdfa"], 2, "PDF/A requires a PDF"),
    ],
)
@pytest.mark.filterwarnings("default")  # Dask's own
def test_invalid_flags(folder, restored, capsys, flags, code, sentence):
    pytest.importorskip("distributed", reason="the extra planish[dask] is not installed here")
    assert command(folder, *flags) == code
    assert sentence in capsys.readouterr().err
    assert restored == []


def test_without_the_extra_the_exit_code_is_6(folder, restored, capsys, monkeypatch):
    import sys

    monkeypatch.setitem(sys.modules, "distributed", None)
    assert command(folder, "--dask", "tcp://localhost:1") == 6
    assert install_command("dask") in capsys.readouterr().err
