"""How true a flat sheet is to the surface it came from: strain, stretch and flips."""

from __future__ import annotations

import numpy as np

from planish.types import Floats, Ints


def strain(page_xy: Floats, pairs: Ints, rest: Floats) -> tuple[float, float]:
    """Root mean square and greatest |l / r - 1| of pairs of points against their rest lengths.

    Parameters
    ----------
    page_xy : (n, 2) float64 [mm]
    pairs : (s, 2) int32
    rest : (s,) float64 [mm]
        Pairs without length are left out.
    """
    long = rest > 0
    length = np.linalg.norm(page_xy[pairs[long, 1]] - page_xy[pairs[long, 0]], axis=1)
    error = length / rest[long] - 1
    return (float(np.sqrt(np.mean(error**2))), float(np.abs(error).max())) if len(error) else (0.0, 0.0)


def stretch(points: Floats, faces: Ints, page_xy: Floats) -> tuple[float, float]:
    """Sander's stretch of the page over the surface: L2 (mean) and L-infinity (greatest); 1 is perfect.

    G and g, the singular values of each face's map from page to surface, give L2 = sqrt(mean of (G^2 + g^2) / 2
    weighted by the surface) and Linf = max G (Sander et al. 2001, eq. 2 and 3). Their scaling by the two areas is
    left out: here both are millimetres, and a page of the wrong size must show. Faces whose page place has no area
    have infinite stretch in principle; they are flips, counted by `flipped_faces`, and left out.

    Parameters
    ----------
    points : (n, 3) float64 [mm]
    faces : (m, 3) int32
    page_xy : (n, 2) float64 [mm]
    """
    s, area = page_xy[faces], signed_areas(faces, page_xy)
    q = points[faces]
    surface = 0.5 * np.linalg.norm(np.cross(q[:, 1] - q[:, 0], q[:, 2] - q[:, 0]), axis=1)
    good = np.abs(area) > 1e-3 * surface.mean() * 1e-3
    s, q, area, surface = s[good], q[good], area[good], surface[good]
    if not len(s):
        return float("inf"), float("inf")
    # Partial derivatives of the surface along page x and y, constant over a face.
    y, x = np.roll(s[..., 1], -1, 1) - np.roll(s[..., 1], 1, 1), np.roll(s[..., 0], 1, 1) - np.roll(s[..., 0], -1, 1)
    along_x = np.einsum("mk,mkd->md", y, q) / (2 * area[:, None])
    along_y = np.einsum("mk,mkd->md", x, q) / (2 * area[:, None])
    a, b, c = (np.einsum("md,md->m", u, v) for u, v in ((along_x, along_x), (along_x, along_y), (along_y, along_y)))
    greatest = np.sqrt(0.5 * ((a + c) + np.sqrt((a - c) ** 2 + 4 * b**2)))
    return float(np.sqrt(np.average((a + c) / 2, weights=surface))), float(greatest.max())


def flipped_faces(faces: Ints, page_xy: Floats) -> int:
    """How many faces lie on the page with their back up (or with no area at all)."""
    return int((signed_areas(faces, page_xy) >= 0).sum())


def signed_areas(faces: Ints, page_xy: Floats) -> Floats:
    """(m,) areas [mm^2] on the page; negative for faces that show their printed side, as y runs down."""
    a, b, c = (page_xy[faces[:, k]] for k in range(3))
    ab, ac = b - a, c - a
    return np.asarray(0.5 * (ab[:, 0] * ac[:, 1] - ab[:, 1] * ac[:, 0]))
