"""Make docs/flattening.webp, a folded letter with its photo on it laid flat: python docs/make_animation.py.

The states are those of the paper's particle system, as in the HTML view, and the last one is the restored page. Its
shading fades at the end, as `planish restore` takes it out.
"""

from pathlib import Path

import cv2
import numpy as np
from PIL import Image
from scipy.spatial.transform import Rotation

import planish
from planish.geometry import project
from planish.mesh import from_file_order, rasterize
from planish.types import Camera, Floats, Pixels, PreparedScan
from planish.view.fall_animation import SHOWN_POINTS, FallAnimation, simulate_fall

SIZE = (720, 540)
FINER = 2
"""Drawn so many times larger and averaged, for smooth borders."""
BACKGROUND = (66, 71, 76)
FRAME_MS, FIRST_MS, LAST_MS = 70, 1200, 3000
FADE = 8
"""Frames in which the shading fades."""
TILT_DEG, TURN_DEG = 47.0, -17.0
"""Of the view from the vertical, and about it."""
DISTANCE_MM = 900.0
MARGIN = 0.03


def main() -> None:
    """Restore a virtual scan of a folded letter and draw its way to the plane."""
    scan = planish.gallery.virtual_scan(
        planish.gallery.sheet("letter"), points=SHOWN_POINTS - 1500, photo_px=(2400, 1800), noise_mm=0.05, turn_deg=0.0
    ).scan
    done = planish.restore(scan)
    prepared = done.prepared
    page_xy = from_file_order(prepared, done.flattening.page_xy)
    fall = simulate_fall(prepared.scan.mesh, prepared.topology, page_xy, done.flattening.size_mm)
    frames, durations = draw_frames(prepared, fall, page_xy, done.page)
    first, *rest = [Image.fromarray(frame) for frame in frames]
    path = Path(__file__).parent / "flattening.webp"
    # kmax: each frame by itself, since differences below a threshold would be left out and pile up while shading fades
    first.save(path, save_all=True, append_images=rest, duration=durations, loop=0, quality=42, method=6, kmax=1)


def draw_frames(
    prepared: PreparedScan, fall: FallAnimation, page_xy: Floats, page: planish.Page
) -> tuple[list[Pixels], list[int]]:
    """All frames and how long each is shown [ms]."""
    photo_xy = project(prepared.scan.camera, prepared.scan.mesh.points)
    camera = camera_for(fall.states)
    frames = [draw(points, fall, camera, prepared.scan.photo, photo_xy) for points in fall.states]
    even = draw(fall.states[-1], fall, camera, _colour(page.pixels), page_xy * page.dpi / 25.4 - 0.5)
    shares = np.linspace(0, 1, FADE + 1)[1:]
    frames += [cv2.addWeighted(frames[-1], 1 - share, even, share, 0) for share in shares]
    durations = [FIRST_MS] + [FRAME_MS] * (len(frames) - 2) + [LAST_MS]
    durations[-FADE - 1] = FIRST_MS  # flat, before the shading fades
    return frames, durations


def camera_for(states: Floats) -> Camera:
    """A camera before the table that sees all states."""
    rotation = Rotation.from_euler("XZ", [180 - TILT_DEG, TURN_DEG], degrees=True).as_matrix()
    seen = states.reshape(-1, 3)[::7] @ rotation.T + [0, 0, DISTANCE_MM]
    flat = seen[:, :2] / seen[:, 2:]
    low, span = flat.min(axis=0), np.ptp(flat, axis=0)
    size = FINER * np.array(SIZE)
    focal = (1 - 2 * MARGIN) * (size / span).min()
    centre = size / 2 - 0.5 - focal * (low + span / 2)
    matrix = np.array([[focal, 0, centre[0]], [0, focal, centre[1]], [0, 0, 1]])
    return Camera(matrix, rotation, np.array([0, 0, DISTANCE_MM]), (int(size[1]), int(size[0])))


def draw(points: Floats, fall: FallAnimation, camera: Camera, picture: Pixels, picture_xy: Floats) -> Pixels:
    """The sheet in one state, with a picture on it."""
    depth = points @ camera.rotation[2] + camera.translation[2]
    face, weights = rasterize(
        project(camera, points), fall.faces, camera.shape_rc, nearness=1 / depth, perspective=True
    )
    corners = picture_xy[fall.faces[np.maximum(face, 0)]]  # (rows, cols, 3, 2)
    place = corners[..., 0, :] + np.einsum("rck,rckj->rcj", weights, corners[..., 1:, :] - corners[..., :1, :])
    drawn = cv2.remap(picture, place.astype(np.float32), None, cv2.INTER_AREA, borderMode=cv2.BORDER_REPLICATE)
    drawn[face < 0] = BACKGROUND
    return cv2.resize(drawn, SIZE, interpolation=cv2.INTER_AREA)


def _colour(pixels: Pixels) -> Pixels:
    return np.repeat(pixels[..., None], 3, axis=2) if pixels.ndim == 2 else pixels


if __name__ == "__main__":
    main()
