import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from planish.mesh import topology
from reference import edges_of
from shapes import grid


@given(st.integers(2, 9), st.integers(2, 9), st.integers(0, 1000))
def test_a_grid_has_the_border_and_edges_that_it_must(rows, cols, seed):
    uv, faces = grid(rows, cols)
    found = topology(np.random.default_rng(seed).permutation(faces), len(uv))
    assert (found.edge_uses == 1).sum() == 2 * (rows - 1) + 2 * (cols - 1)
    assert len(uv) - len(found.edges) + len(faces) == 1  # Euler's number of a disk


@given(st.lists(st.lists(st.integers(0, 7), min_size=3, max_size=3, unique=True), min_size=1, max_size=30))
def test_agrees_with_the_obvious_way_on_any_soup_of_triangles(soup):
    faces = np.array(soup, np.int32)
    found = topology(faces, 8)
    wanted = edges_of(faces)
    assert [tuple(e) for e in found.edges.tolist()] == list(wanted)
    assert found.edge_uses.tolist() == [len(f) for f in wanted.values()]
    for pair, here in zip(found.edge_faces.tolist(), wanted.values(), strict=True):
        assert [f for f in pair if f >= 0] == here[:2]
    for face, edges in zip(faces, found.face_edges, strict=True):
        for k in range(3):
            assert set(found.edges[edges[k]].tolist()) == {face[k], face[(k + 1) % 3]}
