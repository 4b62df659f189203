"""Near point light above the table: irradiance and cast shadows."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from planish.mesh import rasterize
from planish.types import Floats, Ints

SHADOW_PX = 1200
"""Side of the square shadow map: 0.3 mm per pixel on the table."""

SHADOW_MM = 0.5
"""Depth bias of the shadow map, larger on slopes to avoid self-shadowing."""


@dataclass(frozen=True)
class Light:
    """A near point light and ambient light.

    Attributes
    ----------
    position_mm : (float, float, float)
        Position of the lamp.
    ambient : float
        Ambient light, relative to the lamp's irradiance on the table below it.
    exposure : float
        Linear value, 0 to 1, of the brightest white paper; above 1 the photo is overexposed.
    gamma : float
        Pixel values are 255 linear^(1 / gamma).
    shadows : bool
        Whether the sheet casts shadows on the table and on itself.
    """

    position_mm: tuple[float, float, float] = (170.0, -150.0, 480.0)
    ambient: float = 0.3
    exposure: float = 0.95
    gamma: float = 2.2
    shadows: bool = True


def irradiance(light: Light, points: Floats, normals: Floats, lit: Floats) -> Floats:
    """Irradiance at each point: ambient + lit (n.l) (h / d)^2, with h the lamp's height and d its distance.

    Parameters
    ----------
    light : Light
    points, normals : (n, 3) float64
    lit : (n,) float64
        Visible share of the lamp, from `visibility`.
    """
    way = np.asarray(light.position_mm) - points
    distance = np.linalg.norm(way, axis=1)
    facing = np.clip(np.einsum("ij,ij->i", normals, way) / distance, 0, None)
    return light.ambient + lit * facing * (light.position_mm[2] / distance) ** 2


def visibility(light: Light, points: Floats, normals: Floats, faces: Ints) -> Floats:
    """Visible share of the lamp at each point of a scene: 1 in full light, 0 in shadow, between at shadow edges.

    Shadow map (Williams 1978) with 3 x 3 percentage-closer filtering.
    """
    if not light.shadows:
        return np.ones(len(points))
    way = points - np.asarray(light.position_mm)
    depth = -way[:, 2]
    flat = way[:, :2] / depth[:, None]
    low = flat.min(axis=0)
    pixel_xy = (flat - low) * (SHADOW_PX - 1) / np.ptp(flat, axis=0).max()
    face, weights = rasterize(pixel_xy, faces, (SHADOW_PX, SHADOW_PX), nearness=1 / depth, perspective=True)
    corner = depth[faces[face]]
    drawn = corner[..., 0] * (1 - weights.sum(axis=2)) + (corner[..., 1:] * weights).sum(axis=2)
    drawn[face < 0] = np.inf
    col, row = np.clip(np.rint(pixel_xy), 1, SHADOW_PX - 2).astype(int).T
    facing = np.abs(np.einsum("ij,ij->i", normals, way)) / np.linalg.norm(way, axis=1)
    slack = SHADOW_MM * (1 + np.sqrt(1 - facing**2) / np.maximum(facing, 0.1))
    seen = [drawn[row + r, col + c] > depth - slack for r in (-1, 0, 1) for c in (-1, 0, 1)]
    return np.mean(seen, axis=0)
