"""From the mesh of a file to one that can be flattened: mended where that is safe, refused where it is not."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from planish.errors import InputError
from planish.geometry.projection import project
from planish.memory import check_memory
from planish.mesh.measures import angle_sums, area_vectors, border_loops, bounds
from planish.mesh.orient import pieces_and_winding
from planish.mesh.topology import topology
from planish.types import Bools, Diagnostic, Floats, Ints, Mesh, PreparedScan, Scan, Topology, trusted_replace

DUST = 0.01
"""A piece, or a flap at an edge with three faces, below this share of the sheet's area is left out."""

BYTES_PER_POINT = 400.0
"""That repair and flattening take, with two triangles for each point."""


def repair(scan: Scan, *, close_slits: bool = True) -> PreparedScan:
    """Make a scan fit for flattening.

    Left out, with a warning: faces with points that are not finite, faces that use a point twice or stand twice in
    the file, flaps at edges with three faces and pieces below one hundredth of the area, points of no face. Points
    in the same place are welded where that joins pieces or closes a slit in a sheet, but not where a seam was cut
    on purpose (`_weld`). Faces are turned so that neighbours agree and the photo is not seen in a mirror. A scan with
    a camera alone learns where its points lie on the photo.

    Parameters
    ----------
    scan : Scan
    close_slits : bool
        Whether points in the same place are also welded where that joins no pieces.

    Raises
    ------
    InputError
        No faces, no finite area, edges with three faces all over, a closed surface, a strip
        with one side only.
    """
    points, faces = scan.mesh.points, scan.mesh.faces
    _check(points, faces)
    need = BYTES_PER_POINT * max(len(points), len(faces) / 2)
    check_memory(need, f"flattening {len(points):,} points", "let the scanner's software reduce the mesh")
    source = scan
    if scan.camera is not None and scan.photo_xy is None:
        places = project(scan.camera, points)
        scan = trusted_replace(scan, photo_xy=places)
    warnings: list[Diagnostic] = []
    rows = _usable(points, faces, warnings)
    rows, topo = _manifold(points, faces, rows, warnings)
    weld, topo, slits_closed = _weld(points, faces[rows], topo, close_slits, warnings)
    faces = weld[faces] if weld is not None else faces
    piece, turned, clashes = pieces_and_winding(faces[rows], topo)
    if clashes:
        raise InputError("the surface has one side only, like a Moebius strip; a sheet of paper has two")
    kept = _without_dust(area_vectors(points, faces[rows]), piece, warnings)
    if not kept.all():
        rows, turned = rows[kept], turned[kept]
        piece = np.unique(piece[kept], return_inverse=True)[1].astype(np.int32)
    photo_xy = _per_corner(scan, welded=weld is not None)
    turned = _printed_side_up(points, faces[rows], piece, turned, photo_xy, rows, warnings)
    topology_kept = topo if kept.all() else None
    prepared = _assemble(source, scan, faces, rows, piece, turned, photo_xy, weld, topology_kept, warnings)
    return replace(prepared, slits_closed=slits_closed)


def _check(points: Floats, faces: Ints) -> None:
    if not len(points):
        raise InputError("the scan has no points")
    if not len(faces):
        raise InputError(
            f"the scan has {len(points):,} points but no faces; a mesh is needed, so mesh the point cloud first"
        )


def _usable(points: Floats, faces: Ints, warnings: list[Diagnostic]) -> Ints:
    """Rows of the faces whose points are finite and three."""
    finite = np.asarray(np.isfinite(points).all(axis=1))
    rows = np.arange(len(faces), dtype=np.int32)
    if not finite.all():
        good = finite[faces].all(axis=1)
        warnings.append(
            Diagnostic(
                "points-not-finite",
                f"{(~finite).sum():,} points are not finite numbers; they and the {(~good).sum():,} faces at them were "
                "left out",
            )
        )
        rows = rows[good]
    a, b, c = faces[rows].T
    good = (a != b) & (b != c) & (c != a)
    if not good.all():
        warnings.append(Diagnostic("faces-degenerate", f"{(~good).sum():,} faces use a point twice and were left out"))
        rows = rows[good]
    if not len(rows):
        raise InputError("no face of the scan has three different, finite points")
    low, high = bounds(points[_used(faces[rows], len(points))])
    extent = (high - low).max()
    if not np.isfinite(extent) or extent > 1e30:
        raise InputError(f"the scan is {extent:.3g} mm wide; these cannot be millimetres of paper")
    area = np.linalg.norm(area_vectors(points, faces[rows]), axis=1).sum()
    if not area > 1e-9 * extent**2:  # a sheet narrower than a billionth of its length is a line
        raise InputError("all points of the scan lie on one line, so there is no sheet to flatten")
    return rows


def _manifold(points: Floats, faces: Ints, rows: Ints, warnings: list[Diagnostic]) -> tuple[Ints, Topology]:
    """Take away doubled faces and small flaps until no edge has more than two faces."""
    topo = topology(faces[rows], len(points))
    if topo.edge_uses.max() <= 2:
        return rows, topo
    _, first = np.unique(np.sort(faces[rows], axis=1), axis=0, return_index=True)
    if len(first) < len(rows):
        count = len(rows) - len(first)
        warnings.append(
            Diagnostic("faces-duplicate", f"{count:,} faces stand in the file more than once; one of each was kept")
        )
        rows = rows[np.sort(first)]
        topo = topology(faces[rows], len(points))
    crowded = topo.edge_uses > 2
    if not crowded.any():
        return rows, topo
    piece, _, _ = pieces_and_winding(faces[rows], topo)  # pieces end at crowded edges
    area = np.bincount(piece, np.linalg.norm(area_vectors(points, faces[rows]), axis=1))
    at_crowded = np.unique(piece[crowded[topo.face_edges].any(axis=1)])
    flap = np.zeros(len(area), bool)
    flap[at_crowded] = area[at_crowded] < DUST * area.sum()
    left = rows[~flap[piece]]
    trial = topology(faces[left], len(points)) if len(left) else topo
    if trial.edge_uses.max() > 2:
        a, b = topo.edges[np.argmax(crowded)]
        raise InputError(
            f"{crowded.sum():,} edges have more than two faces, the first between points {a} and {b}; a sheet has "
            "at most two at an edge, so repair the mesh (non-manifold edges) first"
        )
    warnings.append(
        Diagnostic(
            "flaps-removed",
            f"{len(rows) - len(left):,} faces hang as flaps at {crowded.sum():,} edges that have more than two faces; "
            "they were left out",
        )
    )
    return left, trial


def _weld(
    points: Floats, faces: Ints, topo: Topology, close_slits: bool, warnings: list[Diagnostic]
) -> tuple[Ints | None, Topology, bool]:
    """Join border points that lie in the very same place, as texture seams and triangle soups need it.

    A seam may also have been cut on purpose, to open a tube or a cone. So the weld is kept only if no edge gets a
    third face, the sheet gets no new handle or tunnel (Euler's number does not fall, pieces apart), and the points
    that come to lie inside have a full turn of angles around them, as flat paper has. Whether a slit within a piece,
    such as a dart, was cut on purpose shows only when the sheet is laid flat; so it is told whether one was closed.

    Returns
    -------
    weld : (n,) int32 or None
        The point that stands for each.
    topology : Topology
    slits_closed : bool
    """
    border = np.unique(topo.edges[topo.edge_uses == 1])
    _, first, group = np.unique(points[border], axis=0, return_index=True, return_inverse=True)
    if len(first) == len(border):
        return None, topo, False
    weld = np.arange(len(points), dtype=np.int32)
    weld[border] = border[first[group.ravel()]]
    welded = weld[faces]
    a, b, c = welded.T
    if ((a == b) | (b == c) | (c == a)).any():
        return None, topo, False
    trial = topology(welded, len(points))
    if trial.edge_uses.max() > 2:
        return None, topo, False
    before, after = (_disks_short(f, t) for f, t in ((faces, topo), (welded, trial)))
    inside = np.setdiff1d(weld[border], trial.edges[trial.edge_uses == 1])
    defect = np.abs(angle_sums(points, welded)[inside] - 2 * np.pi)
    if after > before or (len(inside) and np.median(defect) > 0.2):  # noise leaves 0.1, a cone of 1 in 5 leaves 0.2
        return None, topo, False
    slits = pieces_and_winding(welded, trial)[0].max() == pieces_and_winding(faces, topo)[0].max()
    if slits and not close_slits:
        return None, topo, False
    count = len(border) - len(first)
    warnings.append(Diagnostic("points-welded", f"{count:,} points in the place of another were welded to it"))
    return weld, trial, bool(slits)


def _disks_short(faces: Ints, topo: Topology) -> int:
    """How much the Euler number of a mesh falls short of that of as many plain sheets as it has pieces."""
    used = int(np.count_nonzero(_used(faces, int(faces.max()) + 1)))
    pieces = int(pieces_and_winding(faces, topo)[0].max()) + 1
    return pieces - (used - len(topo.edges) + len(faces))


def _without_dust(vectors: Floats, piece: Ints, warnings: list[Diagnostic]) -> Bools:
    """Which faces belong to pieces worth keeping."""
    area = np.bincount(piece, np.linalg.norm(vectors, axis=1))
    small = area < DUST * area.sum()
    if small.all():
        raise InputError(
            f"the scan is in {len(area):,} pieces, none of them larger than a hundredth of it; it is not a sheet, or "
            "its faces do not share points"
        )
    if small.any():
        share = 100 * area[small].sum() / area.sum()
        sentence = f"{small.sum():,} small loose pieces ({share:.2g} % of the area) were left out"
        warnings.append(Diagnostic("small-pieces-removed", sentence))
    return np.asarray(~small[piece])


def _per_corner(scan: Scan, welded: bool) -> Floats | None:
    """Photo places; per face corner once points are welded, since a seam has two photo places for one point."""
    xy = scan.photo_xy
    return xy[scan.mesh.faces] if xy is not None and welded and xy.ndim == 2 else xy


def _printed_side_up(
    points: Floats,
    faces: Ints,
    piece: Ints,
    turned: Bools,
    photo_xy: Floats | None,
    rows: Ints,
    warnings: list[Diagnostic],
) -> Bools:
    """Decide for every piece which of its two windings is seen from the printed side.

    A photo is never a mirror image: faces that run counter-clockwise on the printed side do so in the photo too,
    which with y down is a negative area. Without a photo the winding that most of the area has in the file stands.
    """
    sign = np.where(turned, -1.0, 1.0)
    area = np.linalg.norm(area_vectors(points, faces), axis=1)
    vote = np.bincount(piece, sign * area)
    if photo_xy is not None:
        corners = photo_xy[rows] if photo_xy.ndim == 3 else photo_xy[faces]
        ab, ac = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
        seen = -0.5 * (ab[:, 0] * ac[:, 1] - ab[:, 1] * ac[:, 0])
        seen[~np.isfinite(seen)] = 0
        by_photo = np.bincount(piece, sign * seen)
        against = np.sign(by_photo) * np.sign(vote) < 0
        if against.any():
            sentence = "the faces run clockwise seen from the side of the photo; they were turned over"
            warnings.append(Diagnostic("faces-clockwise", sentence))
        vote = np.where(by_photo != 0, by_photo, vote)
    turned = turned ^ (vote < 0)[piece]
    minority = min(area[turned].sum(), area[~turned].sum())
    if minority > 0:
        count = min(turned.sum(), (~turned).sum())
        sentence = f"{count:,} faces ran the other way round than their neighbours and were turned over"
        warnings.append(Diagnostic("faces-turned", sentence))
    return np.asarray(turned)


def _assemble(
    source: Scan,
    scan: Scan,
    faces: Ints,
    rows: Ints,
    piece: Ints,
    turned: Bools,
    photo_xy: Floats | None,
    weld: Ints | None,
    topo: Topology | None,
    warnings: list[Diagnostic],
) -> PreparedScan:
    points = scan.mesh.points
    new = faces[rows]
    new[turned] = new[turned][:, [0, 2, 1]]
    if photo_xy is not None and photo_xy.ndim == 3:
        photo_xy = photo_xy[rows]
        photo_xy[turned] = photo_xy[turned][:, [0, 2, 1]]
    new, origin = _own_points(new, piece, len(points))
    mesh_rows = np.full(len(points), -1, np.int32)
    mesh_rows[origin[::-1]] = np.arange(len(origin) - 1, -1, -1, dtype=np.int32)
    shared = len(origin) - np.count_nonzero(mesh_rows >= 0)
    if shared:
        warnings.append(
            Diagnostic(
                "pieces-touch",
                f"{shared:,} points are where pieces touch in a point only; they lie with one piece, and in the flat "
                "mesh the faces of the other are drawn out to them",
            )
        )
    if weld is not None:
        mesh_rows = mesh_rows[weld]
    changed = turned.any() or not np.array_equal(origin, np.arange(len(points)))
    loose = int((mesh_rows < 0).sum())
    if loose:
        warnings.append(
            Diagnostic(
                "points-loose",
                f"{loose:,} points belong to no face of the sheet; they were laid beside their nearest neighbour",
            )
        )
    if photo_xy is not None and photo_xy.ndim == 2:
        photo_xy = photo_xy[origin]
    mesh = Mesh.owned(points[origin], new)
    topo = topology(mesh.faces, len(origin)) if topo is None or changed else topo
    loops, pieces = border_loops(topo), int(piece.max()) + 1
    if not loops or _closed(piece, topo, pieces):
        raise InputError(
            "the surface is closed, without a border; a sheet of paper has one, so cut the mesh open first"
        )
    if pieces > 1:
        sentence = f"the scan is in {pieces} pieces; each is flattened, and all are laid on one page"
        warnings.append(Diagnostic("several-pieces", sentence))
    repaired = trusted_replace(
        scan,
        mesh=mesh,
        photo_xy=photo_xy,
        texture_of_face=None if scan.texture_of_face is None else scan.texture_of_face[rows],
        colours=None if scan.colours is None else scan.colours[origin],
    )
    return PreparedScan(source, repaired, topo, mesh_rows, pieces, max(loops - pieces, 0), tuple(warnings))


def _used(faces: Ints, count: int) -> Bools:
    """(count,) whether each point is a corner of some face."""
    used = np.zeros(count, bool)
    used[faces.ravel()] = True
    return used


def _own_points(faces: Ints, piece: Ints, count: int) -> tuple[Ints, Ints]:
    """Give every piece points of its own, and leave out points of no face: new faces, source row of each point."""
    if piece.max() == 0:
        used = np.zeros(count, bool)
        used[faces] = True
        if used.all():
            return faces, np.arange(count, dtype=np.int32)
        return (np.cumsum(used, dtype=np.int32) - 1).astype(np.int32)[faces], np.flatnonzero(used).astype(np.int32)
    key = faces.astype(np.int64) + piece[:, None].astype(np.int64) * count
    found, new = np.unique(key, return_inverse=True)
    return new.reshape(-1, 3).astype(np.int32), (found % count).astype(np.int32)


def _closed(piece: Ints, topo: Topology, pieces: int) -> bool:
    """Whether some piece has no border at all."""
    at_border = np.zeros(pieces, bool)
    at_border[piece[(topo.edge_uses == 1)[topo.face_edges].any(axis=1)]] = True
    return not bool(at_border.all())
