"""From photos of a sheet, taken from around, to a scan at true size."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace

import numpy as np
from numba import get_num_threads
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from planish.acquire.grid_mesh import AcquiredScan
from planish.acquire.photos.camera_poses import MIN_POINTS, CameraPoses, Lens, find_camera_poses, scaled_pose
from planish.acquire.photos.marked_places import MarkedPlaces, places_on_sheet
from planish.acquire.photos.marker_scale import scale_from_markers
from planish.acquire.photos.markers import find_markers
from planish.acquire.photos.outline import clip_mesh, distance_inside
from planish.acquire.photos.paper import Paper, find_paper
from planish.acquire.photos.surface import SheetSurface, find_surface
from planish.acquire.points.normals import fit_tangent_planes
from planish.color import to_grey, to_uint8
from planish.errors import InputError, UsageError
from planish.geometry import depths, project
from planish.mesh import area_vectors, without_small_components
from planish.settings import PAPERS_MM, USUAL_SHEET_MM, PhotoSettings
from planish.types import Camera, Diagnostic, Floats, Mesh, PhotosReport, Pixels, Scan, View

USUAL_FOCAL = 0.8
"""Focal length, in long sides of the photo, where nothing is known of it."""
FEWEST_VIEWS = 3
"""Points seen by fewer photos are not believed where there are more than three: two rays always nearly meet somewhere
along an epipolar line."""
NEAR_CELLS = 3.0
"""Places of the sheet are measured if something was, so near to them."""
ALIKE = 0.88
"""Least share of the places of print at which a photo must agree with the others: 0.96 and more in sets of one sheet,
at most 0.82 for the photos that do not belong to most others (docs/design-notes-photos.md)."""
MOST_UNLIKE = 1 / 3
"""Share of the photos from which on unlike ones are not left out, but the set is refused."""
WARNED_MM = 0.25
"""Length that may be missing at sharp bends from which a user is warned. Letters folded in three have 0.04, an open
book with a gutter of 118 degrees 0.1, a Miura fold 0.27, a crumpled sheet 0.37; their pages are 0.1, 0.2, 0.7 and
1.4 mm off."""
PAPER_ERROR = 5e-4
"""Of the size from a paper's format: sheets are cut to a tenth of a millimetre or two."""


@dataclass(frozen=True, eq=False)
class SourcePhoto:
    """A photo as it came from a camera.

    Attributes
    ----------
    name : str
    pixels : (rows, cols, 3) uint8 or uint16
        In the orientation of the sensor, if that is known.
    focal_px : float or None
        From EXIF.
    lens : Camera or None
        A calibrated lens; its pose does not count.
    icc : bytes or None
    marked_xy : (2, 2) float64 or None [px]
        Column and row of two places whose distance is known.
    """

    name: str
    pixels: Pixels
    focal_px: float | None = None
    lens: Camera | None = None
    icc: bytes | None = None
    marked_xy: Floats | None = None


@dataclass(frozen=True, eq=False)
class PhotosScan:
    """A scan made from photos.

    Attributes
    ----------
    acquired : AcquiredScan
        `confidence` is 1 where the surface was measured, and falls to 0 where it is bridged.
    views : (n,) int32
        How many photos see each point of the mesh.
    report : PhotosReport
    marked : MarkedPlaces or None
        Places of the sheet whose distance is known.
    """

    acquired: AcquiredScan
    views: NDArray[np.int32]
    report: PhotosReport
    marked: MarkedPlaces | None = None

    def scaled(self, factor: float, scale: str, scale_error: float) -> PhotosScan:
        """The same at another size, from another source."""
        scan, error = self.acquired.scan, factor * self.report.surface_error_mm
        assert scan.camera is not None
        cameras = [scaled_pose(camera, factor) for camera in (scan.camera, *(view.camera for view in scan.others))]
        scan = replace(
            scan,
            mesh=Mesh.owned(factor * scan.mesh.points, scan.mesh.faces),
            camera=cameras[0],
            others=tuple(View.owned(v.photo, c) for v, c in zip(scan.others, cameras[1:], strict=True)),
        )
        known = tuple(note for note in self.acquired.warnings if note.code != "scale-unknown")
        return replace(
            self,
            acquired=replace(self.acquired, scan=scan, noise_mm=error, warnings=known),
            report=replace(
                self.report,
                scale=scale,
                scale_error=scale_error,
                surface_error_mm=error,
                lost_at_bends_mm=factor * self.report.lost_at_bends_mm,
            ),
        )


def from_photos(
    photos: Sequence[SourcePhoto],
    settings: PhotoSettings | None = None,
    *,
    cameras: Sequence[Camera] | None = None,
    progress: Callable[[float], None] | None = None,
) -> PhotosScan:
    """Measure the surface of a sheet from photos of it.

    Cameras come from structure from motion, the surface from patches compared across the photos, the outline from
    paper against ground, the size from markers, from the paper's format, or from the cameras where they are known.

    Parameters
    ----------
    photos : sequence of SourcePhoto
        Two or more, in any order, of the sheet lying still.
    settings : PhotoSettings, optional
        `paper` and `marker_mm` set the size; `width_mm` and `distance_mm` are known of the flat page, and are applied
        afterwards by `planish.pipeline.scale`.
    cameras : sequence of Camera, optional
        Of all photos, in mm, where they are known.
    progress : callable, optional
        Called with the share done.

    Raises
    ------
    InputError
        If the photos do not show one sheet from several sides.
    MissingExtraError
        If pycolmap is not installed.
    """
    s = settings or PhotoSettings()
    done = progress or (lambda share: None)
    if len(photos) < 2:
        raise UsageError("several photos are needed to measure a sheet; one alone is a matter of `planish.photo`")
    photos, cameras = _landscape(photos, cameras)
    grey = [to_grey(photo.pixels) for photo in photos]
    poses = _poses(photos, grey, cameras)
    done(0.4)
    used = [k for k, camera in enumerate(poses.cameras) if camera is not None]
    with ThreadPoolExecutor(get_num_threads()) as pool:  # OpenCV releases the GIL
        papers = list(pool.map(lambda k: find_paper(to_uint8(photos[k].pixels)), used))
    poses, scale, scale_error, warnings = _to_mm(poses, photos, used, s, known=cameras is not None)
    placed = [camera for camera in poses.cameras if camera is not None]
    points = _points_of_sheet(poses, placed, papers)
    done(0.5)
    blanked = [grey[k] if paper is None else paper.blanked(grey[k]) for k, paper in zip(used, papers, strict=True)]
    surface = find_surface(blanked, papers, placed, points, lambda share: done(0.5 + 0.5 * share))
    alike, unlike = _of_one_sheet(surface.likeness, [photos[k].name for k in used])
    warnings += unlike
    used, placed, papers = [used[k] for k in alike], [placed[k] for k in alike], [papers[k] for k in alike]
    mesh, views, near = _cut_out(replace(surface, seen=surface.seen[:, alike]))
    measured = np.clip(2 - near / (NEAR_CELLS * surface.grid.spacing), 0, 1)
    area = np.linalg.norm(area_vectors(mesh.points, mesh.faces), axis=1)
    error = float(np.median(surface.measured.sigma))
    report = PhotosReport(
        photos=len(photos),
        used=len(used),
        left_out=[photo.name for k, photo in enumerate(photos) if k not in used],
        scale=scale,
        scale_error=scale_error,
        focal_px=float(placed[0].matrix[0, 0]),
        reprojection_px=poses.error_px,
        angle_deg=poses.angle_deg,
        measured_fraction=float(area @ (measured[mesh.faces].mean(axis=1) > 0.5) / area.sum()),
        surface_error_mm=error,
        lost_at_bends_mm=surface.lost_at_bends(),
    )
    scan = _scan(mesh, [photos[k] for k in used], placed)
    unplaced = [photo.name for photo, camera in zip(photos, poses.cameras, strict=True) if camera is None]
    warnings += _notes(report, papers, unplaced)
    marked = _marked(mesh, photos, poses.cameras)
    found = PhotosScan(AcquiredScan(scan, measured, error, tuple(warnings)), views, report, marked)
    if s.paper == "unknown":
        return found
    paper = PAPERS_MM[s.paper]
    found = replace(found, acquired=replace(found.acquired, scan=replace(scan, paper_mm=paper)))
    return found.scaled(float(np.sqrt(np.prod(paper) / _area(mesh))), "paper", PAPER_ERROR)


def _landscape(
    photos: Sequence[SourcePhoto], cameras: Sequence[Camera] | None
) -> tuple[list[SourcePhoto], Sequence[Camera] | None]:
    """Turn upright photos on their side, so that all photos of one lens have one shape; known cameras need none."""
    if cameras is not None:
        return list(photos), cameras
    turned = []
    for photo in photos:
        upright = photo.pixels.shape[0] > photo.pixels.shape[1] and photo.lens is None
        turned.append(_on_its_side(photo) if upright else photo)
    return turned, None


def _on_its_side(photo: SourcePhoto) -> SourcePhoto:
    turned = np.rot90(photo.pixels)
    pixels = turned.astype(np.uint8) if photo.pixels.dtype == np.uint8 else turned.astype(np.uint16)
    if photo.marked_xy is None:
        return replace(photo, pixels=pixels)
    x, y = photo.marked_xy.T
    return replace(photo, pixels=pixels, marked_xy=np.stack([y, photo.pixels.shape[1] - 1 - x], axis=1))


def _poses(
    photos: Sequence[SourcePhoto], grey: Sequence[NDArray[np.uint8]], cameras: Sequence[Camera] | None
) -> CameraPoses:
    """Where the photos were taken; those of equal size and focal length share a lens."""
    kinds: dict[tuple[object, ...], int] = {}
    lenses: list[Lens] = []
    lens_of_photo = []
    for photo in photos:
        shape = photo.pixels.shape[0], photo.pixels.shape[1]
        key = (shape, None if photo.focal_px is None else round(photo.focal_px), id(photo.lens))
        if key not in kinds:
            kinds[key] = len(lenses)
            lenses.append(Lens(shape, photo.focal_px or USUAL_FOCAL * max(shape), photo.lens))
        lens_of_photo.append(kinds[key])
    return find_camera_poses(grey, lens_of_photo, lenses, cameras)


def _to_mm(
    poses: CameraPoses,
    photos: Sequence[SourcePhoto],
    used: Sequence[int],
    settings: PhotoSettings,
    *,
    known: bool,
) -> tuple[CameraPoses, str, float | None, list[Diagnostic]]:
    """The cameras in mm: by markers, as they are known, or so that the sheet is about as large as A4."""
    warnings: list[Diagnostic] = []
    if settings.marker_mm is not None:
        markers = [find_markers(photo.pixels) for photo in photos]
        found = scale_from_markers(markers, poses.cameras, settings.marker_mm)
        if found is None:
            raise InputError(
                "no ArUco marker of DICT_4X4_50 is seen by two of the photos, so the size is not known",
                "lay the card of `planish calibrate card` beside the sheet, or give {paper}",
            )
        if found.refused:
            numbers = ", ".join(str(n) for n in found.refused)
            sentence = f"markers of another size than the rest were left out: number {numbers}"
            warnings.append(Diagnostic("markers-refused", sentence))
        return poses.scaled(found.factor), "marker", found.relative_error, warnings
    if known:
        return poses, "cameras", poses.error_px / float(photos[used[0]].pixels.shape[1]), warnings
    extent = float(np.linalg.norm(np.quantile(poses.points, 0.95, axis=0) - np.quantile(poses.points, 0.05, axis=0)))
    return poses.scaled(USUAL_SHEET_MM / extent), "unknown", None, warnings


def _points_of_sheet(poses: CameraPoses, cameras: Sequence[Camera], papers: Sequence[Paper | None]) -> Floats:
    """Points on the sheet: within its outline in most photos, and seen by enough of them."""
    sure = poses.views >= min(FEWEST_VIEWS, len(cameras) - 1)
    points = poses.points[sure]
    if any(paper is not None for paper in papers):
        everywhere = np.ones((len(points), len(cameras)), bool)
        points = points[np.nan_to_num(distance_inside(points, everywhere, cameras, papers), nan=-1) > 0]
    if len(points) >= MIN_POINTS:
        points = points[fit_tangent_planes(points).kept]  # a false point far off bends blank paper around it
    if len(points) < MIN_POINTS:
        raise InputError(
            f"only {len(points)} places of the sheet were found again in the photos; take more photos, from nearer, in "
            "good light, each overlapping the others"
        )
    return points


def _of_one_sheet(likeness: Floats, names: Sequence[str]) -> tuple[list[int], list[Diagnostic]]:
    """Which photos show the same sheet, and a warning that names the others.

    Raises
    ------
    InputError
        If too many do not: then nobody can know which of them show the sheet.
    """
    alike = [k for k, share in enumerate(likeness) if share >= ALIKE]
    unlike = [k for k, share in enumerate(likeness) if share < ALIKE]
    if not unlike:
        return alike, []
    percent = 100 * likeness[unlike]
    found = f"{percent.min():.0f}" if len(unlike) == 1 else f"{percent.min():.0f} to {percent.max():.0f}"
    listed = ", ".join(names[k] for k in unlike)
    if len(unlike) > MOST_UNLIKE * len(names):
        raise InputError(
            f"the photos show different sheets, or a sheet that was moved or bent between them: {listed} show the same "
            f"as the others at only {found} % of the places of print that they should share",
            "give photos of one sheet that lay still",
        )
    sentence = (
        f"{listed} {'shows' if len(unlike) == 1 else 'show'} the same as the other photos at only {found} % of the "
        "places of print: another sheet, or the sheet was moved or bent in between; left out"
    )
    return alike, [Diagnostic("photos-unlike", sentence, "take photos of one sheet that lies still")]


def _cut_out(surface: SheetSurface) -> tuple[Mesh, NDArray[np.int32], Floats]:
    """The sheet within its outline: mesh, photos that see each point, distance to what was measured."""
    nodes = surface.grid.to_space(surface.heights)
    inside = surface.inside_mm.ravel()
    if not np.isfinite(inside).any():
        inside = surface.within_points(nodes)
    inside = np.nan_to_num(inside, nan=-surface.grid.spacing)
    points, faces, ends, _ = clip_mesh(nodes, surface.grid.faces(), inside)
    if not len(faces):
        raise InputError("nothing of the sheet's surface was found within its outline; is it seen by several photos?")
    kept, faces = without_small_components(faces, len(points), only_largest=True)  # a card may stand apart
    points, ends = points[kept], ends[kept]
    views = surface.seen.sum(axis=1)[ends].max(axis=1).astype(np.int32)
    near = cKDTree(surface.measured.points).query(points)[0]
    return Mesh.owned(points, faces), views, near


def _marked(mesh: Mesh, photos: Sequence[SourcePhoto], cameras: Sequence[Camera | None]) -> MarkedPlaces | None:
    for photo, camera in zip(photos, cameras, strict=True):
        if photo.marked_xy is None:
            continue
        if camera is None:
            raise InputError(
                f"the places were marked in {photo.name}, which shows too little in common with the other photos; mark "
                "them in another"
            )
        return places_on_sheet(mesh, camera, photo.marked_xy, photo.name)
    return None


def _area(mesh: Mesh) -> float:
    return float(np.linalg.norm(area_vectors(mesh.points, mesh.faces), axis=1).sum())


def _scan(mesh: Mesh, photos: Sequence[SourcePhoto], cameras: Sequence[Camera]) -> Scan:
    """The photo that shows the sheet largest comes first."""
    sizes = [float(np.median(camera.matrix[0, 0] / depths(camera, mesh.points))) for camera in cameras]
    first = int(np.argmax(sizes))
    rest = [k for k in range(len(photos)) if k != first]
    return Scan(
        mesh,
        photos[first].pixels,
        project(cameras[first], mesh.points),
        cameras[first],
        icc=photos[first].icc,
        others=tuple(View(photos[k].pixels, cameras[k]) for k in rest),
    )


def _notes(report: PhotosReport, papers: Sequence[Paper | None], unplaced: Sequence[str]) -> list[Diagnostic]:
    """What a user should know of the photos, the gravest first."""
    notes = []
    if report.scale == "unknown":
        notes.append(
            Diagnostic(
                "scale-unknown",
                "photos alone do not tell how large the sheet is, so the page has no true size",
                "give {marker_mm} with a printed marker beside the sheet, {paper} or {width_mm}",
            )
        )
    if report.lost_at_bends_mm > WARNED_MM:
        sentence = (
            "the sheet bends sharply where nothing is printed, as crumpled paper does; the page may be a millimetre or "
            "two too short across it"
        )
        notes.append(Diagnostic("bends-bridged", sentence, "smooth the sheet there, or use a scanner"))
    if unplaced:
        sentence = (
            f"{len(unplaced)} of {report.photos} photos show too little in common with the others and were left out: "
            f"{', '.join(unplaced)}"
        )
        notes.append(Diagnostic("photos-left-out", sentence))
    if all(paper is None for paper in papers):
        sentence = "the sheet does not stand out from its ground on any photo, so its borders are those of its print"
        notes.append(Diagnostic("sheet-not-found", sentence, "lay it on something of another colour"))
    return notes
