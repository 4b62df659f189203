"""What a page distorts, face by face and in figures, for programs that judge parameterizations."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from planish.display.one_line import one_line
from planish.errors import UsageError
from planish.mesh import area_vectors
from planish.sticks import face_distortion
from planish.types import Flattening, Floats, Mesh, freeze


@dataclass(frozen=True, eq=False)
class Distortion:
    """Distortion of every face of a mesh on its page, against the mesh as it came, with the scanner's noise.

    All are NaN for faces that the repair left out and for faces without area.

    Attributes
    ----------
    area : (m,) float64
        Relative change of the area: 0.01 where the page is 1 % larger than the surface.
    angle_deg : (m,) float64 [degrees]
        The most that an angle between two directions changes.
    length : (m,) float64
        The greatest relative change of length in any direction, with its sign.
    strain : (m,) float64
        `Flattening.face_strain`: against the rest lengths, without the scanner's noise where that was taken out.
    area_mm2 : (m,) float64 [mm^2]
        Of the face on the surface, by which means and quantiles are weighted.
    """

    area: Floats
    angle_deg: Floats
    length: Floats
    strain: Floats
    area_mm2: Floats

    __repr__ = one_line

    def __post_init__(self) -> None:
        freeze(self)

    def arrays(self) -> dict[str, Floats]:
        """Each measure by its name."""
        return {"area": self.area, "angle_deg": self.angle_deg, "length": self.length, "strain": self.strain}

    def columns(self) -> dict[str, Floats]:
        """The same under the names that they have beside others, as in a PLY file."""
        return {
            "area_distortion": self.area,
            "angle_distortion_deg": self.angle_deg,
            "length_distortion": self.length,
            "face_strain": self.strain,
        }

    def summary(self) -> dict[str, Any]:
        """Figures of the whole page as plain numbers.

        Returns
        -------
        dict
            `faces`, `faces_left_out`, and of each measure `mean`, `p99` and `worst` of its size, and `worst_face`, its
            row. Mean and p99 are weighted by the area on the surface: 99 % of the surface is at or below p99.
        """
        left_out = np.isnan(self.area)
        figures = {name: _figures(np.abs(values), self.area_mm2) for name, values in self.arrays().items()}
        return {"faces": len(self.area), "faces_left_out": int(left_out.sum()), **figures}


def distortion(mesh: Any, flat: Flattening) -> Distortion:
    """Measure how a flattening distorts its mesh, face by face.

    The map of every face to the page has the singular values s >= t: its area changes by s t - 1, an angle by at most
    2 asin((s - t) / (s + t)) (Tissot; Snyder 1987), a length by s - 1 or t - 1.

    Parameters
    ----------
    mesh : Mesh, or a mesh of trimesh, Open3D or PyVista
        That was flattened, in mm.
    flat : Flattening
        Of it.

    Raises
    ------
    UsageError
        If the flattening is of another mesh, or has no strain of faces.

    Examples
    --------
    >>> from planish.gallery import sheet, sheet_mesh
    >>> from planish.pipeline import flatten
    >>> mesh, _ = sheet_mesh(sheet("book"), points=500)
    >>> figures = distortion(mesh, flatten(mesh)).summary()
    >>> sorted(figures["area"]), figures["area"]["mean"] < 0.01
    (['mean', 'p99', 'worst', 'worst_face'], True)
    """
    mesh = mesh if isinstance(mesh, Mesh) else Mesh(mesh)
    faces, strain = len(mesh.faces), flat.face_strain
    if strain is None or len(flat.page_xy) != len(mesh.points) or len(strain) != faces:
        raise UsageError(
            f"the mesh has {len(mesh.points):,} points and {faces:,} faces, the flattening {len(flat.page_xy):,} points"
            f" and {0 if strain is None else len(strain):,} faces; give the mesh that was flattened"
        )
    values = face_distortion(mesh.points, mesh.faces, flat.page_xy)
    values[np.isnan(strain)] = np.nan
    strain = np.where(np.isnan(values[:, 0]), np.nan, strain)
    surface = np.linalg.norm(area_vectors(mesh.points, mesh.faces), axis=1)
    area, angle, length = values.T
    return Distortion(area, angle, length, strain, surface)


def _figures(sizes: Floats, weights: Floats) -> dict[str, float | int | None]:
    known = np.flatnonzero(np.isfinite(sizes))
    if not len(known):
        return dict.fromkeys(("mean", "p99", "worst", "worst_face"))
    order = known[np.argsort(sizes[known], kind="stable")]
    share = np.cumsum(weights[order])
    at = int(np.searchsorted(share, 0.99 * share[-1]))
    return {
        "mean": float(np.average(sizes[known], weights=weights[known])),
        "p99": float(sizes[order[at]]),
        "worst": float(sizes[order[-1]]),
        "worst_face": int(order[-1]),
    }
