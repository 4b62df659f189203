"""Caps and needles: triangles whose lengths do not tell which way up they lie."""

import numpy as np
import pytest

import planish
from planish.flattening.untangle import untangle
from planish.geometry.distances import distances
from planish.mesh import edges_with_area, relative_heights, topology
from planish.report import flipped_faces
from planish.sticks import stretch
from planish.sticks.build import bending_weights
from shapes import arch, grid, rigid_rms


def with_caps(uv, faces, off, every=23):
    """A point just off the longest side of every 23rd face, on the far side of it by `off` of its length.

    The face becomes two; the sliver between them and the old side is a cap that lies on its back if `off` > 0, as a
    point measured a little to one side brings it about.
    """
    uv, faces = list(uv), [list(face) for face in faces]
    for f in range(0, len(faces), every):
        a, b, c = faces[f]
        sides = [(a, b, c), (b, c, a), (c, a, b)]
        a, b, c = max(sides, key=lambda side: np.linalg.norm(uv[side[1]] - uv[side[0]]))
        along = uv[b] - uv[a]
        uv.append((uv[a] + uv[b]) / 2 + off * np.array([along[1], -along[0]]))
        p = len(uv) - 1
        faces[f] = [a, p, c]
        faces += [[p, b, c], [a, b, p]]
    return np.array(uv), np.array(faces, np.int32)


@pytest.fixture(scope="module")
def capped():
    return with_caps(*grid(15, 11), off=0.004)  # 179.1 degrees


@pytest.mark.parametrize("method", ["multigrid", "verlet"])
def test_caps_on_their_back_drag_no_neighbours(capped, method):
    uv, faces = capped
    points = arch(uv, 300.0)
    flat = planish.flatten(points, faces, planish.FlattenSettings(lengths="unfolded", method=method, points="all"))
    assert flat.outcome is planish.Outcome.SETTLED
    # Chords of 20 mm are 0.02 % short; the wrong sign of a height of 0.1 mm makes some edges 0.5 % wrong.
    # A guard that turns caps over leaves 0.12 mm and edges 1.1 % off.
    assert rigid_rms(flat.page_xy * [1, -1], uv) < 0.06
    assert flat.strain[0] < 0.001
    assert flat.strain[1] < 0.005


def test_caps_on_their_back_are_no_flips(capped):
    uv, faces = capped
    page, points = uv * [1, -1], np.c_[uv, np.zeros(len(uv))]
    caps = flipped_faces(faces, page)
    assert caps == len(uv) - 15 * 11 > 0
    assert flipped_faces(faces, page, points) == 0
    found = topology(faces, len(uv))
    same, flipped = untangle(uv, faces, found, distances(uv, found.edges))
    assert flipped == 0
    assert np.array_equal(same, uv)


def test_faces_with_area_on_their_back_are_flips():
    uv, faces = with_caps(*grid(15, 11), off=0.05)  # 168 degrees
    points = np.c_[uv, np.zeros(len(uv))]
    assert flipped_faces(faces, uv * [1, -1], points) == len(uv) - 15 * 11


def test_strain_and_stretch_are_not_those_of_faces_without_area():
    uv, faces = with_caps(*grid(15, 11), off=0.0)
    points = np.c_[uv, np.zeros(len(uv))]
    page = uv * [1, -1]
    page[15 * 11 :] += [0.0, 0.05]  # apexes off by a four-hundredth of their face's side
    assert stretch(points, faces, page)[1] < 1.02
    # A needle: the two ends of its short side a hundredth of a millimetre apart on the surface, a tenth on the page.
    needle = np.array([[0.0, 0, 0], [20, 0, 0], [20, 0.01, 0], [0, 20, 0]])
    faces = np.array([[0, 1, 2], [0, 2, 3]], np.int32)
    found = topology(faces, 4)
    lengths = distances(needle, found.edges)
    counts = edges_with_area(lengths, found.face_edges)
    assert counts.tolist() == [set(edge) not in ({1, 2}, {0, 1}) for edge in found.edges]
    flat = planish.flatten(needle, faces, planish.FlattenSettings(lengths="unfolded"))
    assert flat.strain[1] < 1e-6


def test_relative_heights():
    lengths = np.array([1.0, 1.0, 1.0, np.sqrt(2), 2.0, 0.0])
    rows = np.array([[0, 1, 2], [0, 1, 3], [0, 1, 4], [0, 5, 1], [5, 5, 5], [0, 5, 4]], np.int32)
    # Equilateral, right-angled, a line, a needle without width, a point, lengths that close to no triangle.
    assert relative_heights(lengths, rows) == pytest.approx([np.sqrt(3) / 2, 0.5, 0, 0, 0, 0], abs=1e-7)


def test_bending_sticks_across_faces_without_area_weigh_less(capped):
    uv, faces = capped
    found = topology(faces, len(uv))
    rest = distances(uv, found.edges)
    edge = np.flatnonzero(found.edge_uses == 2)
    weight = bending_weights(rest, edge, found)
    low = relative_heights(rest, found.face_edges) < 0.02
    touched = low[found.edge_faces[edge]].any(axis=1)
    assert (weight[~touched] == 1).all()
    assert weight[touched] == pytest.approx(0.04, rel=1e-6)  # (0.004 / 0.02)^2
