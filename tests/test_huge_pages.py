"""Pages of no usual size: told before the work begins, and drawn in seconds."""

import json
from dataclasses import replace

import numpy as np
import pytest

from planish.cli.main import run
from planish.errors import InputError
from planish.gallery import sheet, virtual_scan
from planish.io import write_scan
from planish.types import Camera, Mesh, Scan


def test_a_page_of_two_metres_is_drawn_as_finely_as_the_photo_shows_it(tmp_path, capsys):
    scan = virtual_scan(sheet("book"), points=3000, photo_px=(1000, 750)).scan
    huge = replace(scan, mesh=Mesh(10 * scan.mesh.points, scan.mesh.faces))
    camera = scan.camera
    huge = replace(huge, camera=replace(camera, translation=10 * camera.translation))
    write_scan(tmp_path / "s.ply", huge)
    run(["restore", f"{tmp_path}/s.ply", "-o", f"{tmp_path}/p.png", "--units", "mm", "--report", f"{tmp_path}/r.json"])
    report = json.loads((tmp_path / "r.json").read_text())
    assert report["page"]["height_mm"] > 2500
    assert 4 < report["page"]["dpi"] < 15
    assert "page-huge" in report["warning_codes"]
    notes = capsys.readouterr().err.splitlines()
    assert "from corner to corner" in notes[0]  # what the reader found comes first
    sentences = {
        note.removeprefix("planish: ").split(": ", 1)[1] for note in notes
    }  # the verdict repeats an early note
    assert len(notes) == len(set(notes))
    assert len(sentences) == len(report["warnings"])


PHOTO = np.full((60, 80, 3), 200, np.uint8)
MESH = Mesh([[0, 0, 0], [100, 0, 0], [100, 70, 0], [0, 70, 0]], [[0, 1, 2], [0, 2, 3]])


def test_texture_coordinates_are_no_pixels():
    with pytest.raises(InputError, match=r"from 0 to 1, but the photo is 80 x 60 pixels"):
        Scan(MESH, PHOTO, [[0, 0], [1, 0], [1, 1], [0, 1]])
    with pytest.raises(InputError, match="no part of the sheet falls on the photo"):
        Scan(MESH, PHOTO, [[200, 0], [300, 0], [300, 50], [200, 50]])
    assert Scan(MESH, PHOTO, [[0, 0], [79, 0], [79, 59], [0, 59]]).photo_xy.shape == (4, 2)


def test_a_camera_for_another_photo_is_refused():
    camera = Camera(np.diag([100.0, 100, 1]), np.eye(3), np.array([0, 0, 200.0]), (120, 160))
    with pytest.raises(InputError, match="80 x 60 pixels, but the camera is for one of 160 x 120"):
        Scan(MESH, PHOTO, camera=camera)
