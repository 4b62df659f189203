"""Cuts within a sheet whose sides meet in space: a dart stays open, a slit in flat paper is closed."""

import numpy as np
import pytest

import planish
from planish.gallery import sheet, sheet_mesh
from planish.types import Mesh, Scan
from shapes import rigid_rms


def cone(degrees, columns=41, rings=12, radius=100.0):
    """A disc without a wedge of so many degrees, rolled up until its cut closes: points, faces, flat truth."""
    share = 1 - degrees / 360
    turn, far = np.meshgrid(np.linspace(0, 2 * np.pi, columns), np.linspace(0, radius, rings + 1)[1:])
    turn, far = turn.ravel(), far.ravel()
    points = np.c_[far * share * np.cos(turn), far * share * np.sin(turn), -far * np.sqrt(1 - share**2)]
    first, last = np.arange(rings) * columns, np.arange(rings) * columns + columns - 1
    points[last] = points[first]  # to the last digit, as files have it
    i = (np.arange(rings - 1)[:, None] * columns + np.arange(columns - 1)).ravel() + 1
    tip = np.arange(1, columns)
    faces = np.concatenate(
        [
            np.stack([np.zeros_like(tip), tip, tip + 1], axis=1),
            np.stack([i, i + columns, i + columns + 1], axis=1),
            np.stack([i, i + columns + 1, i + 1], axis=1),
        ]
    )
    flat = np.c_[far * np.cos(share * turn), far * np.sin(share * turn)]
    return np.r_[np.zeros((1, 3)), points], faces.astype(np.int32), np.r_[np.zeros((1, 2)), flat]


def codes(warnings):
    return [warning.code for warning in warnings]


@pytest.mark.parametrize("degrees", [4, 15, 60])
def test_a_dart_stays_open(degrees):
    points, faces, truth = cone(degrees)
    flat = planish.flatten(points, faces, planish.FlattenSettings(lengths="unfolded"))  # the tip looks like a spike
    assert "slits-open" in codes(flat.warnings)
    assert "points-welded" not in codes(flat.warnings)
    # Closed, the two sides of a cut of 15 degrees lie together, 13 mm from where they belong at half the radius.
    assert rigid_rms(flat.page_xy * [1, -1], truth) < 0.1  # chords of 9 degrees of turn


def test_the_report_of_a_dart_is_of_the_open_sheet():
    points, faces, _ = cone(15)
    done = planish.restore(Scan(Mesh(points, faces)))
    assert "slits-open" in codes(done.report.warnings)
    assert done.report.flatten.strain_rms < 1e-3
    assert not done.prepared.slits_closed


@pytest.mark.parametrize("noise", [0, 0.2])
def test_a_slit_in_paper_is_closed(noise):
    mesh, truth = sheet_mesh(sheet("letter"), 2500, layout="grid", noise_mm=noise)
    upper = truth[mesh.faces, 1].mean(axis=1) < np.median(truth[:, 1])
    seam = np.intersect1d(mesh.faces[upper], mesh.faces[~upper])
    seam = seam[truth[seam, 0] < np.median(truth[:, 0])]
    other = np.arange(len(truth))
    other[seam] = len(truth) + np.arange(len(seam))
    faces = mesh.faces.copy()
    faces[upper] = other[faces[upper]]
    flat = planish.flatten(np.r_[mesh.points, mesh.points[seam]], faces)
    assert "points-welded" in codes(flat.warnings)
    assert "slits-open" not in codes(flat.warnings)
    assert np.array_equal(flat.page_xy[seam], flat.page_xy[len(truth) :])
