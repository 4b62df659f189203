"""Where the pieces of one sheet lie on its page.

A scanner does not see into the shadow along a fold or a spine, so the sheet may come in pieces with a narrow gap
between them. Where two borders face each other across such a gap, the sheet between them is taken to bend as little
as it can: evenly where the sides stand nearly in one plane, sharply along the line where their planes meet where they
do not. That gives each point of one border a place in the plane of the other piece, and the piece the turn and shift
that fit these places best.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numba import njit
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from planish.geometry.guards import TINY, normalize
from planish.mesh import Topology, area_vectors, neighbours
from planish.types import Floats, Ints

Complex = NDArray[np.complex128]

WIDEST = 0.04
"""Gaps wider than this part of the sheet's side are not bridged: 10 mm on a letter."""

HOSTS = 16
"""Pieces that others may be joined to: the largest."""

FACING = 0.35
"""Least cosine between the way out of a piece and the way across the gap; at a right-angled fold it is 0.7."""

FEWEST = 8
"""Border points that must face the other piece."""

LONGER = 3.0
"""How many times longer than wide a gap must be, so that its length tells the turn."""

MISFIT = 0.2
"""Rms misfit of the borders, as part of the gap's width, up to which its geometry is plain."""

ROUNDS = 6
"""Rounds of averaging normals over neighbours, as the noise of a single face turns it by ten degrees."""


EVEN_DEG, SHARP_DEG = 12.0, 28.0
"""Up to this angle between its sides a gap is taken to bend evenly, from that angle on along one line."""


@dataclass(frozen=True, eq=False)
class GapAlignment:
    """Two pieces and the motion that brings the second beside the first: z -> turn * z + shift.

    `length` and `width` of the gap in mm.
    """

    first: int
    second: int
    turn: complex
    shift: complex
    length: float
    width: float

    def reversed(self) -> GapAlignment:
        """The motion that brings the first beside the second."""
        back = 1 / self.turn
        return GapAlignment(self.second, self.first, back, -back * self.shift, self.length, self.width)


def number_pieces(piece: Ints) -> tuple[Ints, int]:
    """Numbers 0, 1, 2 ... for pieces, the one with most points first."""
    names, number, size = np.unique(piece, return_inverse=True, return_counts=True)
    rank = np.empty(len(names), np.int64)
    rank[np.argsort(-size, kind="stable")] = np.arange(len(names))
    return rank[number].astype(np.int32), len(names)


def pack_pieces(xy: Floats, piece: Ints, count: int, room: float) -> Floats:
    """Shift pieces so that the boxes around them lie in rows, `room` [mm] apart."""
    low, high = np.full((count, 2), np.inf), np.full((count, 2), -np.inf)
    np.minimum.at(low, piece, xy)
    np.maximum.at(high, piece, xy)
    size = high - low + room
    row_width = max(float(size[0, 0]), 1.3 * float(np.sqrt(size.prod(1).sum())))
    corner, at, row_height = np.empty((count, 2)), np.zeros(2), 0.0
    for p in range(count):
        if at[0] > 0 and at[0] + size[p, 0] > row_width:
            at, row_height = np.array([0.0, at[1] + row_height]), 0.0
        corner[p] = at
        at[0] += size[p, 0]
        row_height = max(row_height, float(size[p, 1]))
    return np.asarray(xy + (corner - low)[piece])


def orient_to_view(points: Floats, faces: Ints, xy: Floats, piece: Ints, count: int) -> Floats:
    """Turn each piece as it is seen when one looks at the printed side of the largest, x to the right.

    Parameters
    ----------
    points : (n, 3) float64 [mm]
    faces : (m, 3) int32
    xy : (n, 2) float64 [mm]
        Flat places of the same points, y up.
    piece : (n,) int32
    count : int
    """
    towards_eye = _area_vector(points, faces, piece)
    towards_eye /= np.linalg.norm(towards_eye) or 1.0
    right = np.eye(3)[0 if abs(towards_eye[0]) < 0.9 else 1]
    right = right - (right @ towards_eye) * towards_eye
    right /= np.linalg.norm(right)
    turned = np.empty_like(xy)
    _rotate_to_view(points, xy, piece, count, right, np.cross(towards_eye, right), turned)
    return turned


def align_pieces(
    points: Floats, faces: Ints, topology: Topology, xy: Floats, piece: Ints, count: int, edge: float
) -> tuple[Floats, Ints, list[GapAlignment]]:
    """Move pieces to where the gaps between their borders tell that they belong.

    Parameters
    ----------
    points, faces, topology : the mesh
    xy : (n, 2) float64 [mm]
        Pieces, each flat by itself; y up.
    piece : (n,) int32
    count : int
    edge : float [mm]
        A usual edge.

    Returns
    -------
    xy : (n, 2) float64 [mm]
    group : (n,) int32
        Pieces that were joined have the number of the largest of them.
    joints : list of GapAlignment
    """
    z = xy[:, 0] + 1j * xy[:, 1]
    rim = _Rim.of(points, faces, topology, z, piece)
    widest = WIDEST * edge * np.sqrt(len(points))
    candidates = [joint for host in range(min(count - 1, HOSTS)) for joint in _joints_to(rim, host, widest, edge)]
    turn, shift, group = np.ones(count, np.complex128), np.zeros(count, np.complex128), np.arange(count, dtype=np.int32)
    used = []
    for joint in sorted(candidates, key=lambda j: -j.length):
        a, b = joint.first, joint.second
        if group[a] == group[b]:
            continue
        if group[b] < group[a]:  # the group with the larger piece stays where it is
            joint = joint.reversed()
            a, b = b, a
        # Where b must lie, less where it lies, is what its whole group has to do.
        turn_by = turn[a] * joint.turn / turn[b]
        shift_by = turn[a] * joint.shift + shift[a] - turn_by * shift[b]
        moved = group == group[b]
        turn[moved] *= turn_by
        shift[moved] = turn_by * shift[moved] + shift_by
        group[moved] = group[a]
        used.append(joint)
    z = turn[piece] * z + shift[piece]
    return np.column_stack([z.real, z.imag]), group[piece], used


@dataclass(frozen=True, eq=False)
class _Rim:
    """Border points of all pieces: in space, on the page, and how the one is laid on the other.

    `right`, `up`: tangents of the surface that lie along x and y of the page; `out`: the tangent that leaves the
    piece; all (k, 3). `z`: places on the page, (k,) complex.
    """

    piece: Ints
    place: Floats
    z: Complex
    normal: Floats
    right: Floats
    up: Floats
    out: Floats

    @staticmethod
    def of(points: Floats, faces: Ints, topology: Topology, z: Complex, piece: Ints) -> _Rim:
        """Collect the border."""
        normal = _smooth_normals(points, faces, topology)
        border = topology.edges[topology.edge_uses == 1]
        inner = faces[topology.edge_faces[topology.edge_uses == 1, 0]].sum(1) - border.sum(1)
        at = np.unique(border)
        out = np.zeros_like(points)
        for end in (0, 1):  # away from the third corner of the face
            np.add.at(out, border[:, end], points[border].mean(1) - points[inner])
        n = normal[at]
        right = _turned_tangents(points, topology, z, n, at)
        away = out[at] - np.einsum("ij,ij->i", out[at], n)[:, None] * n
        return _Rim(piece[at], points[at], z[at], n, right, np.cross(n, right), normalize(away))


def _joints_to(rim: _Rim, host: int, widest: float, edge: float) -> list[GapAlignment]:
    """Joints of smaller pieces to one piece, where their borders face each other plainly."""
    ours, theirs = np.flatnonzero(rim.piece == host), np.flatnonzero(rim.piece > host)
    if not len(ours) or not len(theirs):
        return []
    distance, nearest = cKDTree(rim.place[ours]).query(rim.place[theirs], distance_upper_bound=widest)
    near = np.isfinite(distance)
    a, b = ours[nearest[near]], theirs[near]
    across = rim.place[b] - rim.place[a]
    width = np.maximum(np.linalg.norm(across, axis=1), TINY)
    facing = np.minimum(np.einsum("ij,ij->i", rim.out[a], across), -np.einsum("ij,ij->i", rim.out[b], across))
    plain = facing > FACING * width
    a, b = a[plain], b[plain]
    joints = [
        _fit(rim, a[rim.piece[b] == p], b[rim.piece[b] == p], host, int(p), edge) for p in np.unique(rim.piece[b])
    ]
    return [joint for joint in joints if joint is not None]


def _fit(rim: _Rim, a: Ints, b: Ints, first: int, second: int, edge: float) -> GapAlignment | None:
    """Motion of the second piece that fits border points a of the first and b of the second; None if not plain."""
    if len(a) < FEWEST:
        return None
    over = _unfolded(rim.place[b] - rim.place[a], rim.normal[a], rim.normal[b])
    from_a = np.einsum("ij,ij->i", over[0], rim.right[a]) + 1j * np.einsum("ij,ij->i", over[0], rim.up[a])
    from_b = np.einsum("ij,ij->i", over[1], rim.right[b]) + 1j * np.einsum("ij,ij->i", over[1], rim.up[b])
    source, target = np.concatenate([rim.z[b], rim.z[b] - from_b]), np.concatenate([rim.z[a] + from_a, rim.z[a]])
    turn, shift, misfit = _rigid(source, target)
    good = misfit <= 2.5 * np.median(misfit) + 1e-12
    turn, shift, misfit = _rigid(source[good], target[good])
    width = float(np.median(np.abs(from_a)))
    length = float(np.ptp((rim.z[a] * _along(rim.z[a])).real))
    rms = float(np.sqrt(np.mean(misfit**2)))
    if length < LONGER * max(width, edge) or rms > MISFIT * max(width, edge):
        return None
    return GapAlignment(first, second, turn, shift, length, width)


def _unfolded(across: Floats, normal_a: Floats, normal_b: Floats) -> tuple[Floats, Floats]:
    """The way across a gap as it runs over the sheet, seen in the tangent plane at either end.

    With m halfway between the normals and c along the fold, the part along c is kept; the rest, in the plane across
    m, is stretched: from chord to arc where the sides stand nearly in one plane, to the two sides of the triangle
    that the planes make with it where they do not.
    """
    middle, fold = normalize(normal_a + normal_b), np.cross(normal_a, normal_b)
    angle = np.arctan2(np.linalg.norm(fold, axis=1), np.einsum("ij,ij->i", normal_a, normal_b))
    flat = across - np.einsum("ij,ij->i", across, middle)[:, None] * middle
    fold = np.where(angle[:, None] > 1e-6, normalize(fold), normalize(np.cross(middle, flat)))
    along = np.einsum("ij,ij->i", flat, fold)
    side = np.cross(middle, fold)
    beside = np.einsum("ij,ij->i", flat, side)
    blend = np.clip((np.degrees(angle) - EVEN_DEG) / (SHARP_DEG - EVEN_DEG), 0, 1)
    half = np.minimum(angle, np.radians(150)) / 2
    longer = (1 - blend) * (1 + angle**2 / 24) + blend / np.cos(half)
    over = [along[:, None] * fold + (longer * beside)[:, None] * np.cross(n, fold) for n in (normal_a, normal_b)]
    return over[0], over[1]


def _rigid(source: Complex, target: Complex) -> tuple[complex, complex, Floats]:
    """Turn and shift that take source nearest to target, and how far each point is off."""
    a, b = source - source.mean(), target - target.mean()
    turn = np.sum(a.conj() * b)
    turn = turn / abs(turn) if abs(turn) > 0 else 1.0 + 0j
    shift = target.mean() - turn * source.mean()
    return complex(turn), complex(shift), np.abs(turn * source + shift - target)


def _along(z: Complex) -> complex:
    """The factor that turns the direction in which points spread most onto the real axis."""
    return complex(np.exp(-0.5j * np.angle(np.sum((z - z.mean()) ** 2))))


def _smooth_normals(points: Floats, faces: Ints, topology: Topology) -> Floats:
    """Normals of points, averaged over the neighbours again and again; gaps are not bridged."""
    vector = area_vectors(points, faces)
    corner = faces.ravel()
    normal: Floats = np.zeros_like(points)
    for d in range(3):
        normal[:, d] = np.bincount(corner, np.repeat(vector[:, d], 3), len(points))
    start, around = neighbours(topology.edges, len(points))
    for _ in range(ROUNDS):
        normal = normalize(_with_neighbours(start, around, normal))
    return normal


def _turned_tangents(points: Floats, topology: Topology, z: Complex, normal: Floats, at: Ints) -> Floats:
    """Tangents at points `at` that lie along x on the page, from the edges around them in space and on the page."""
    first = normalize(np.cross(normal, np.eye(3)[np.abs(normal).argmin(1)]))
    second = np.cross(normal, first)
    row = np.full(len(points), -1)
    row[at] = np.arange(len(at))
    spin = np.zeros(len(at), np.complex128)
    for a, b in ((0, 1), (1, 0)):
        here, there = topology.edges[:, a], topology.edges[:, b]
        mine = row[here] >= 0
        here, there, k = here[mine], there[mine], row[here[mine]]
        arm = points[there] - points[here]
        seen = np.einsum("ij,ij->i", arm, first[k]) + 1j * np.einsum("ij,ij->i", arm, second[k])
        np.add.at(spin, k, seen * (z[there] - z[here]).conj())
    spin = np.where(np.abs(spin) > 0, spin / np.maximum(np.abs(spin), TINY), 1.0)
    return spin.real[:, None] * first + spin.imag[:, None] * second


@njit(cache=True, nogil=True)
def _with_neighbours(start, around, normal):  # type: ignore[no-untyped-def]
    total = normal.copy()
    for i in range(len(normal)):
        for at in range(start[i], start[i + 1]):
            for d in range(3):
                total[i, d] += normal[around[at], d]
    return total


@njit(cache=True, nogil=True)
def _area_vector(points, faces, piece):  # type: ignore[no-untyped-def]
    """Sum of the area vectors of the largest piece: the way its printed side looks."""
    total = np.zeros(3)
    for f in range(len(faces)):
        i, j, k = faces[f, 0], faces[f, 1], faces[f, 2]
        if piece[i] != 0:
            continue
        ux, uy, uz = points[j, 0] - points[i, 0], points[j, 1] - points[i, 1], points[j, 2] - points[i, 2]
        vx, vy, vz = points[k, 0] - points[i, 0], points[k, 1] - points[i, 1], points[k, 2] - points[i, 2]
        total[0] += uy * vz - uz * vy
        total[1] += uz * vx - ux * vz
        total[2] += ux * vy - uy * vx
    return total


@njit(cache=True, nogil=True)
def _rotate_to_view(points, xy, piece, count, right, up, turned):  # type: ignore[no-untyped-def]
    """Least-squares turn of each piece about its middle, towards what is seen along `right` and `up`."""
    middle = np.zeros((count, 3))
    for i in range(len(xy)):
        p = piece[i]
        middle[p, 0] += xy[i, 0]
        middle[p, 1] += xy[i, 1]
        middle[p, 2] += 1.0
    spin = np.zeros((count, 3))
    for i in range(len(xy)):
        p = piece[i]
        x, y = xy[i, 0] - middle[p, 0] / middle[p, 2], xy[i, 1] - middle[p, 1] / middle[p, 2]
        u = v = 0.0
        for d in range(3):
            u += points[i, d] * right[d]
            v += points[i, d] * up[d]
        spin[p, 0] += x * u + y * v
        spin[p, 1] += x * v - y * u
        spin[p, 2] += x * x + y * y
    for p in range(count):
        length = np.sqrt(spin[p, 0] ** 2 + spin[p, 1] ** 2)
        if length > 1e-9 * spin[p, 2]:
            spin[p, 0] /= length
            spin[p, 1] /= length
        else:
            spin[p, 0], spin[p, 1] = 1.0, 0.0
    for i in range(len(xy)):
        p = piece[i]
        x, y = xy[i, 0] - middle[p, 0] / middle[p, 2], xy[i, 1] - middle[p, 1] / middle[p, 2]
        turned[i, 0] = spin[p, 0] * x - spin[p, 1] * y
        turned[i, 1] = spin[p, 1] * x + spin[p, 0] * y
