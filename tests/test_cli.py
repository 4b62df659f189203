"""The command line as a user meets it: files in, files out, one sentence and the right exit code when it is wrong."""

import json
import os
import resource
import signal
import subprocess
import sys
import time
from importlib import metadata

import numpy as np
import pytest
from PIL import Image

from planish.cli.main import run
from planish.io import write_scan

# a page of a bound book, small enough for a test and large enough to be read


@pytest.fixture(scope="module")
def book(book_scan, tmp_path_factory):
    path = tmp_path_factory.mktemp("book") / "book.obj"
    write_scan(path, book_scan.scan)
    return path, book_scan


@pytest.fixture
def own_book(book, tmp_path):
    """A copy that a test may break."""
    for file in book[0].parent.iterdir():
        (tmp_path / file.name).write_bytes(file.read_bytes())
    return tmp_path / "book.obj"


def fails(capsys, code, sentence, *arguments):
    """The command ends with the code and says the sentence, once, in one line, with no traceback."""
    assert run([str(a) for a in arguments]) == code
    said = capsys.readouterr().err.strip().splitlines()
    assert len(said) == 1, said
    assert said[0].startswith("planish: ")
    assert sentence in said[0], said[0]


class TestRestore:
    @pytest.mark.slow
    def test_a_book_page_comes_out_at_true_size_with_all_that_was_asked_for(self, book, tmp_path, capsys):
        path, made = book
        out = [tmp_path / name for name in ("page.tif", "bw.png", "flat.obj", "report.json", "stages")]
        page, binary, flat, report, stages = out
        assert (
            run(
                ["restore", str(path), "-o", str(page), "--binary", str(binary), "--flat", str(flat)]
                + ["--report", str(report), "--stages", str(stages), "--dpi", "150"]
            )
            == 0
        )
        assert capsys.readouterr().out == ""  # nothing is printed into a pipe
        said = json.loads(report.read_text())
        sheet_mm = made.sheet.width_mm, made.sheet.height_mm
        assert (said["page"]["width_mm"], said["page"]["height_mm"]) == pytest.approx(sheet_mm, rel=0.005)
        with Image.open(page) as image:
            assert image.info["dpi"] == pytest.approx((150, 150))
            assert image.size == pytest.approx([mm / 25.4 * 150 for mm in sheet_mm], rel=0.005)
        with Image.open(binary) as image:
            assert image.mode == "1"
        moved = [line.split() for line in flat.read_text().splitlines() if line.startswith("v ")]
        assert len(moved) == len(made.scan.mesh.points)
        assert {row[3] for row in moved} == {"0"}
        names = sorted(p.name for p in stages.iterdir())
        assert names == [
            "1-warped.png",
            "2-warped-binary.png",
            "3-mesh-before.png",
            "4-mesh-after.png",
            "5-restored.png",
            "6-restored-binary.png",
            "7-expected-error.png",
            "8-strain.png",
            "all.png",
        ]

    @pytest.mark.slow
    def test_promised_keys_of_the_report_are_there(self, book, tmp_path):
        report = tmp_path / "r.json"
        assert (
            run(["restore", str(book[0]), "-o", str(tmp_path / "p.png"), "--report", str(report), "--dpi", "100"]) == 0
        )
        said = json.loads(report.read_text())
        promised = (
            "outcome seconds_total seconds scan.points scan.faces flatten.method flatten.points flatten.iterations "
            "flatten.seconds flatten.strain_rms flatten.strain_max flatten.strain_raw_rms flatten.stretch_l2 "
            "flatten.stretch_linf flatten.flipped_faces page.width_mm page.height_mm page.dpi page.effective_ppi_p10 "
            "page.effective_ppi_median page.known_fraction warnings"
        )
        for key in promised.split():
            value = said
            for part in key.split("."):
                value = value[part]
            assert value is not None, key
        assert said["scan"]["points"] == len(book[1].scan.mesh.points)
        assert set(said["seconds"]) >= {"read", "clean", "flatten", "render", "measure", "write"}
        assert "binarize" not in said["seconds"]  # it was not asked for

    @pytest.mark.slow
    @pytest.mark.parametrize("suffix", ["tif", "png", "jpg", "pdf"])
    def test_the_suffix_decides_the_format(self, book, tmp_path, suffix):
        page = tmp_path / f"page.{suffix}"
        assert run(["restore", str(book[0]), "-o", str(page), "--dpi", "75"]) == 0
        magic = {"tif": (b"II", b"MM"), "png": (b"\x89PNG",), "jpg": (b"\xff\xd8",), "pdf": (b"%PDF",)}[suffix]
        assert page.read_bytes().startswith(magic)

    @pytest.mark.slow
    def test_a_number_turns_the_page_clockwise_from_the_photo(self, book, tmp_path):
        sizes = {}
        for turn in ("0", "90", "180"):
            page = tmp_path / f"{turn}.png"
            assert run(["restore", str(book[0]), "-o", str(page), "--dpi", "50", "--rotate", turn]) == 0
            sizes[turn] = np.asarray(Image.open(page).convert("L"), float)
        assert sizes["90"].shape == sizes["0"].T.shape
        # Pixels of the turned page fall up to half a step aside; a page turned wrongly differs several times as much.
        wrong = np.abs(sizes["0"] - sizes["180"]).mean()
        assert np.abs(np.rot90(sizes["0"], -1) - sizes["90"]).mean() < wrong / 3
        assert np.abs(sizes["0"][::-1, ::-1] - sizes["180"]).mean() < wrong / 3

    @pytest.mark.slow
    def test_each_method_and_length_can_be_chosen(self, book, tmp_path):
        report = tmp_path / "r.json"
        for lengths in ("straight", "unfolded"):
            assert (
                run(
                    [
                        "flatten",
                        str(book[0]),
                        "-o",
                        str(tmp_path / "f.obj"),
                        "--method",
                        "verlet",
                        "--lengths",
                        lengths,
                        "--points",
                        "500",
                        "--report",
                        str(report),
                    ]
                )
                == 0
            )
            flat = json.loads(report.read_text())["flatten"]
            assert (flat["method"], flat["lengths"]) == ("verlet", lengths)
            assert flat["points"] == pytest.approx(500, rel=0.25)  # of 4,000: spacings of whole mesh cells only

    @pytest.mark.slow
    def test_a_sheet_that_does_not_settle_is_written_and_ends_with_5(self, book, tmp_path, capsys):
        flat = tmp_path / "flat.obj"
        assert run(["flatten", str(book[0]), "-o", str(flat), "--method", "verlet", "--verlet.max-steps", "3"]) == 5
        assert "still moving when the steps ran out" in capsys.readouterr().err
        assert flat.exists()


class TestBadInput:
    def test_no_such_file(self, tmp_path, capsys):
        fails(capsys, 3, "no such file", "restore", tmp_path / "none.obj", "-o", tmp_path / "p.tif")

    def test_not_a_mesh(self, tmp_path, capsys):
        (tmp_path / "x.obj").write_text("Dear Sir or Madam,\n\nplease find attached the scan.\n")
        fails(capsys, 3, "x.obj", "restore", tmp_path / "x.obj", "-o", tmp_path / "p.tif")

    def test_an_obj_cut_in_half(self, own_book, tmp_path, capsys):
        data = own_book.read_bytes()
        own_book.write_bytes(data[: len(data) // 2])
        fails(capsys, 3, "cut short", "restore", own_book, "-o", tmp_path / "p.tif")

    def test_an_index_out_of_range(self, own_book, tmp_path, capsys):
        own_book.write_text(own_book.read_text() + "f 1 2 999999\n")
        fails(capsys, 3, "999998, but the file has", "restore", own_book, "-o", tmp_path / "p.tif")

    @pytest.mark.slow
    def test_points_that_are_not_numbers_are_left_out_and_said(self, own_book, tmp_path, capsys):
        lines = own_book.read_text().splitlines()
        at = [k for k, line in enumerate(lines) if line.startswith("v ")]
        lines[at[500]], lines[at[900]] = "v nan nan nan", "v inf 0 0"
        own_book.write_text("\n".join(lines) + "\n")
        assert run(["restore", str(own_book), "-o", str(tmp_path / "p.png"), "--dpi", "75"]) == 0
        assert "2 points are not finite" in capsys.readouterr().err

    def test_zero_faces(self, own_book, tmp_path, capsys):
        kept = [line for line in own_book.read_text().splitlines() if not line.startswith("f ")]
        own_book.write_text("\n".join(kept) + "\n")
        fails(capsys, 3, "no faces", "restore", own_book, "-o", tmp_path / "p.tif")

    def test_a_mug(self, tmp_path, capsys):
        import trimesh

        trimesh.creation.icosphere(3, 50.0).export(tmp_path / "mug.obj")
        fails(capsys, 3, "closed", "flatten", tmp_path / "mug.obj", "-o", tmp_path / "f.obj")

    def test_points_on_one_line(self, tmp_path, capsys):
        (tmp_path / "line.obj").write_text("v 0 0 0\nv 100 0 0\nv 200 0 0\nf 1 2 3\n")
        fails(capsys, 3, "on one line", "flatten", tmp_path / "line.obj", "-o", tmp_path / "f.obj")

    def test_an_edge_with_many_faces(self, tmp_path, capsys):
        fan = "".join(f"v {100 * np.cos(a):.3f} {100 * np.sin(a):.3f} 0\n" for a in range(4))
        (tmp_path / "fan.obj").write_text("v 0 0 0\nv 0 0 100\n" + fan + "f 1 2 3\nf 1 2 4\nf 1 2 5\nf 1 2 6\n")
        fails(capsys, 3, "more than two faces", "flatten", tmp_path / "fan.obj", "-o", tmp_path / "f.obj")

    @pytest.mark.slow
    def test_two_sheets_are_both_flattened_and_said(self, own_book, tmp_path, capsys):
        lines = own_book.read_text().splitlines()
        points = [line.split()[1:4] for line in lines if line.startswith("v ")]
        faces = [[c.split("/")[0] for c in line.split()[1:]] for line in lines if line.startswith("f ")]
        text = "".join(f"v {x} {y} {z}\n" for x, y, z in points)
        text += "".join(f"v {float(x) + 400} {y} {z}\n" for x, y, z in points)
        text += "".join(f"f {' '.join(f)}\n" for f in faces)
        text += "".join(f"f {' '.join(str(int(i) + len(points)) for i in f)}\n" for f in faces)
        (tmp_path / "two.obj").write_text(text)
        assert run(["flatten", str(tmp_path / "two.obj"), "-o", str(tmp_path / "f.obj"), "--units", "mm"]) in (0, 5)
        assert "2 pieces" in capsys.readouterr().err

    @pytest.mark.slow
    def test_a_hundred_thousand_random_points(self, tmp_path, capsys):
        rng = np.random.default_rng(0)
        points, faces = rng.normal(0, 100, (100_000, 3)), rng.integers(1, 100_001, (50_000, 3))
        with (tmp_path / "random.obj").open("w") as file:
            np.savetxt(file, points, "v %.4f %.4f %.4f")
            np.savetxt(file, faces, "f %d %d %d")
        assert run(["flatten", str(tmp_path / "random.obj"), "-o", str(tmp_path / "f.obj")]) == 3
        assert capsys.readouterr().err.startswith("planish: ")

    def test_the_photo_is_missing(self, own_book, tmp_path, capsys):
        for photo in (*own_book.parent.glob("*.jpg"), *own_book.parent.glob("*.png")):
            photo.unlink()
        assert run(["restore", str(own_book), "-o", str(tmp_path / "p.tif")]) == 3
        assert "photo" in capsys.readouterr().err

    def test_the_photo_is_cut_short(self, own_book, tmp_path, capsys):
        photo = next(p for p in own_book.parent.iterdir() if p.suffix in (".jpg", ".png"))
        photo.write_bytes(photo.read_bytes()[:2000])
        fails(capsys, 3, photo.name, "restore", own_book, "-o", tmp_path / "p.tif")

    def test_the_photo_has_another_size_than_the_camera_says(self, own_book, tmp_path, capsys):
        photo = tmp_path / "other.png"
        Image.new("RGB", (320, 200), "white").save(photo)
        camera = tmp_path / "camera.json"
        camera.write_text(
            json.dumps(
                {
                    "matrix": [[900, 0, 400], [0, 900, 300], [0, 0, 1]],
                    "rotation": np.eye(3).tolist(),
                    "translation": [0, 0, 500],
                    "image_size": [800, 600],
                }
            )
        )
        fails(capsys, 3, "320", "restore", own_book, "--photo", photo, "--camera", camera, "-o", tmp_path / "p.tif")

    @pytest.mark.slow
    @pytest.mark.parametrize("mode", ["I;16", "CMYK", "L", "P"])
    def test_photos_of_other_kinds_are_drawn(self, own_book, tmp_path, mode):
        photo = next(p for p in own_book.parent.iterdir() if p.suffix in (".jpg", ".png"))
        grey = Image.open(photo).convert("L")
        other = tmp_path / "other.tif"
        if mode == "I;16":
            Image.fromarray(np.asarray(grey).astype(np.uint16) * 257).save(other)
        else:
            grey.convert("RGB").convert(mode).save(other)
        page = tmp_path / "p.png"
        assert run(["restore", str(own_book), "--photo", str(other), "-o", str(page), "--dpi", "75"]) == 0
        drawn = np.asarray(Image.open(page).convert("L") if mode != "I;16" else Image.open(page)).astype(float)
        assert drawn.std() > 10  # the text is there

    def test_a_photo_of_one_pixel_gives_a_page_of_one_colour_or_a_sentence(self, own_book, tmp_path, capsys):
        Image.new("RGB", (1, 1), (200, 10, 10)).save(tmp_path / "one.png")
        code = run(["restore", str(own_book), "--photo", str(tmp_path / "one.png"), "-o", str(tmp_path / "p.png")])
        assert code in (0, 3)
        assert "Traceback" not in capsys.readouterr().err

    @pytest.mark.parametrize(("scale", "size"), [(0.007, "mm"), (7.0, "mm")])
    def test_a_page_of_2_mm_or_2_m_is_doubted(self, own_book, tmp_path, capsys, scale, size):
        lines = own_book.read_text().splitlines()
        scaled = [
            "v " + " ".join(f"{float(n) * scale:.6f}" for n in line.split()[1:4]) if line.startswith("v ") else line
            for line in lines
        ]
        own_book.write_text("\n".join(scaled) + "\n")
        assert run(["flatten", str(own_book), "-o", str(tmp_path / "f.obj"), "--units", size]) == 0
        assert "unit" in capsys.readouterr().err


class TestBadOutput:
    def test_no_such_folder(self, book, tmp_path, capsys):
        fails(capsys, 4, "no folder", "restore", book[0], "-o", tmp_path / "none" / "p.tif")

    def test_a_suffix_that_is_no_format(self, book, tmp_path, capsys):
        code = run(["restore", str(book[0]), "-o", str(tmp_path / "p.xyz")])
        assert code in (2, 4)
        assert ".xyz" in capsys.readouterr().err

    def test_a_file_in_place_is_kept_if_so_asked(self, book, tmp_path, capsys):
        (tmp_path / "p.tif").write_text("mine")
        fails(capsys, 4, "exists", "restore", book[0], "-o", tmp_path / "p.tif", "--no-overwrite")
        assert (tmp_path / "p.tif").read_text() == "mine"

    def test_a_folder_that_may_not_be_written_to(self, book, tmp_path, capsys, monkeypatch):
        monkeypatch.setattr(
            os, "access", lambda *a, **k: False
        )  # root may write anywhere, so the system's no is played
        fails(capsys, 4, "not permitted", "restore", book[0], "-o", tmp_path / "p.tif")

    @pytest.mark.slow
    def test_a_full_disk_leaves_the_old_page_and_nothing_half_written(self, book, tmp_path):
        """A limit on the size of files stands in for a full disk: the system refuses in the middle of the page."""
        page = tmp_path / "page.tif"
        page.write_text("the old page")

        def limited():
            signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
            resource.setrlimit(resource.RLIMIT_FSIZE, (200_000, 200_000))

        done = subprocess.run(
            [sys.executable, "-m", "planish", "restore", str(book[0]), "-o", str(page)],
            capture_output=True,
            text=True,
            preexec_fn=limited,
        )
        assert done.returncode == 4, done.stderr
        assert "Traceback" not in done.stderr
        assert page.read_text() == "the old page"
        assert [p.name for p in tmp_path.iterdir()] == ["page.tif"]

    @pytest.mark.slow
    def test_ctrl_c_leaves_nothing_half_written(self, book, tmp_path):
        page = tmp_path / "page.tif"
        job = subprocess.Popen(
            [sys.executable, "-m", "planish", "restore", str(book[0]), "-o", str(page), "--dpi", "1200"],
            stderr=subprocess.PIPE,
            preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL),  # a job in the background ignores it
            text=True,
        )
        time.sleep(1.5)
        job.send_signal(signal.SIGINT)
        _, said = job.communicate(timeout=60)
        assert job.returncode == 130, said
        assert "Traceback" not in said
        assert list(tmp_path.iterdir()) == []


class TestCommandLine:
    def test_no_such_flag(self, book, capsys):
        fails(capsys, 2, "--flavour", "restore", book[0], "-o", "p.tif", "--flavour", "mint")

    def test_a_value_that_is_none_of_the_choices(self, book, capsys):
        fails(capsys, 2, "--method", "restore", book[0], "-o", "p.tif", "--method", "magic")

    @pytest.mark.parametrize("flag", [["--dpi", "0"], ["--points", "2"], ["--verlet.rounds", "0"]])
    def test_a_value_out_of_range(self, book, capsys, flag):
        fails(capsys, 2, flag[0].split(".")[-1].lstrip("-"), "restore", book[0], "-o", "p.tif", *flag)

    def test_help_names_every_command(self, capsys):
        assert run(["--help"]) == 0
        out = capsys.readouterr().out
        assert all(name in out for name in ("demo", "restore", "flatten"))

    def test_help_loads_no_compiler_and_no_codec(self):
        code = (
            "import sys; from planish.cli.main import run; run(['--help'])\n"
            "print({'numba', 'cv2', 'scipy'} & {*sys.modules})"
        )
        done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
        assert done.stdout.strip().endswith("set()")

    def test_the_version(self, capsys):
        from planish.version import __version__

        assert run(["--version"]) == 0
        assert capsys.readouterr().out.strip() == __version__


class TestDoctor:
    def test_it_names_versions_extras_and_what_is_missing(self, capsys, monkeypatch):
        truly = metadata.version

        def version(name):
            if name == "numpy":
                raise metadata.PackageNotFoundError
            return truly(name)

        monkeypatch.setattr(metadata, "version", version)
        assert run(["doctor"]) == 0
        told = dict(line.split(maxsplit=1) for line in capsys.readouterr().out.splitlines())
        assert told["planish"].startswith(truly("planish"))
        assert int(told["cores"]) >= 1
        assert told["compiled"].split()[1:3] == ["kernels", "in"]
        assert "numpy missing" in told["libraries"]
        assert f"scipy {truly('scipy')}" in told["libraries"]
        assert {"[web]", "[photos]", "[ocr]"} <= set(told)

    def test_planish_from_its_sources(self, capsys, monkeypatch):
        def requires(name):
            raise metadata.PackageNotFoundError

        monkeypatch.setattr(metadata, "requires", requires)
        assert run(["doctor"]) == 0
        assert "without being installed" in capsys.readouterr().out
