"""The size of a sheet from the distance of two places that were marked in one of its photos."""

import numpy as np
import pytest
from PIL import Image

from planish.acquire.grid_mesh import AcquiredScan
from planish.acquire.photos.marked_places import MarkedPlaces, places_on_sheet
from planish.acquire.photos.scan import PhotosScan, SourcePhoto, _landscape
from planish.errors import InputError, UsageError
from planish.gallery import sheet
from planish.gallery.scene_view import aim_camera
from planish.geometry import project
from planish.io.images import as_stored, read_photo
from planish.io.photo_set import read_photo_set
from planish.job.stage_images import write_stages
from planish.mesh import grid_faces
from planish.pipeline import restore
from planish.pipeline.scale import scaled_by_page
from planish.settings import BinarizeSettings, PhotoSettings, RenderSettings, RestoreSettings, ShadingSettings
from planish.types import Mesh, PhotosReport, Scan

CAMERA = aim_camera((60.0, -120.0, 500.0), (108.0, 140.0, 0.0), 300.0, (900, 1200))
PAGE_XY = np.array([[30.3, 41.7], [181.2, 228.4]])


def wave_scan(scale):
    """A sheet in waves, all of it so many times as large as it truly is, and where the camera sees two places of it."""
    wave = sheet("wave")
    across, down = np.meshgrid(np.linspace(0, wave.width_mm, 60), np.linspace(0, wave.height_mm, 80))
    points = wave.bend(np.stack([across.ravel(), down.ravel()], axis=1))
    camera = aim_camera((scale * 60, scale * -120, scale * 500), scale * np.array([108.0, 140, 0]), 300.0, (900, 1200))
    mesh = Mesh.owned(scale * points, grid_faces(np.arange(4800, dtype=np.int32).reshape(80, 60), scale * points))
    return mesh, camera, project(camera, scale * wave.bend(PAGE_XY))


def found_from(mesh, camera, marked):
    report = PhotosReport(2, 2, [], "unknown", None, 1000.0, 0.3, 40.0, 1.0, 0.05)
    scan = Scan(mesh, np.zeros((900, 1200, 3), np.uint8), project(camera, mesh.points), camera)
    acquired = AcquiredScan(scan, np.ones(len(mesh.points)), 0.05, ())
    return PhotosScan(acquired, np.full(len(mesh.points), 2, np.int32), report, marked)


@pytest.mark.parametrize("scale", [0.7, 1.6])
def test_a_distance_along_the_paper_gives_the_true_size(scale):
    mesh, camera, photo_xy = wave_scan(scale)
    true = float(np.linalg.norm(PAGE_XY[1] - PAGE_XY[0]))
    found = found_from(mesh, camera, places_on_sheet(mesh, camera, photo_xy, "a.jpg"))
    settings = PhotoSettings(distance_mm=true, between=("a.jpg", *photo_xy.ravel()))
    scaled = scaled_by_page(found, settings)
    assert scaled.report.scale == "distance"
    # chords of 3.7 mm are shorter than the waves by half a per mille
    assert scaled.acquired.scan.mesh.points == pytest.approx(mesh.points / scale, rel=1e-3, abs=1e-6)
    # two pixels of 370 apart, and a fifth of a millimetre of the ruler
    apart = np.linalg.norm(photo_xy[1] - photo_xy[0])
    assert scaled.report.scale_error == pytest.approx(np.hypot(2**0.5 / apart, 0.2 / true))


def test_of_two_layers_the_nearer_one_was_marked():
    square = np.array([[0.0, 0, 0], [200, 0, 0], [200, 200, 0], [0, 200, 0]])
    mesh = Mesh.owned(
        np.concatenate([square, square + [0, 0, 40]]), np.array([[0, 1, 2], [0, 2, 3], [4, 5, 6], [4, 6, 7]])
    )
    marked = places_on_sheet(mesh, CAMERA, project(CAMERA, np.array([[50.0, 60, 40], [120, 110, 40]])), "a.jpg")
    assert (marked.corners >= 4).all()
    assert marked.apart(mesh.points[:, :2]) == pytest.approx(np.hypot(70, 50))


def test_a_place_beside_the_sheet_is_refused():
    mesh, camera, photo_xy = wave_scan(1.0)
    with pytest.raises(InputError, match=r"the marked place of a\.jpg is not on the sheet"):
        places_on_sheet(mesh, camera, np.array([photo_xy[0], [3.0, 3.0]]), "a.jpg")


@pytest.mark.parametrize("orientation", range(1, 9))
def test_places_are_those_of_the_picture_as_it_is_shown(tmp_path, orientation):
    stored = np.zeros((30, 40, 3), np.uint8)
    stored[4, 7] = 255
    exif = Image.Exif()
    exif[0x0112] = orientation
    Image.fromarray(stored).save(tmp_path / "a.png", exif=exif)
    shown = read_photo(tmp_path / "a.png", upright=True).pixels[..., 0]
    row, col = np.argwhere(shown == 255)[0]
    photo = read_photo(tmp_path / "a.png")
    assert as_stored(np.array([[col, row]], float), photo).tolist() == [[7.0, 4.0]]


def test_places_turn_with_an_upright_photo():
    pixels = np.zeros((40, 30, 3), np.uint8)
    pixels[4, 7] = pixels[31, 22] = 255
    photo = SourcePhoto("a.jpg", pixels, marked_xy=np.array([[7.0, 4], [22, 31]]))
    (turned,), _ = _landscape([photo], None)
    assert turned.pixels.shape == (30, 40, 3)
    assert [turned.pixels[int(y), int(x), 0] for x, y in turned.marked_xy] == [255, 255]


def test_marks_go_to_the_photo_that_was_named(tmp_path):
    files = [tmp_path / f"{name}.png" for name in "ab"]
    for file in files:
        Image.new("L", (40, 30)).save(file)
    photos, _, _ = read_photo_set(files, None, ("b.png", 3, 4, 20, 25))
    assert photos[0].marked_xy is None
    assert photos[1].marked_xy.tolist() == [[3, 4], [20, 25]]
    with pytest.raises(UsageError, match=r"marked in c\.png, which is none of the 2 photos"):
        read_photo_set(files, None, ("c.png", 3, 4, 20, 25))
    with pytest.raises(UsageError, match="shown with 40 x 30 pixels"):
        read_photo_set(files, None, ("b.png", 3, 4, 45, 25))


@pytest.mark.parametrize(
    ("settings", "problem"),
    [
        ({"distance_mm": 100.0}, "go together"),
        ({"between": ("a.jpg", 1, 2, 3, 4)}, "go together"),
        ({"distance_mm": 100.0, "between": ("a.jpg", 1, 2, 1, 2)}, "one place twice"),
        ({"distance_mm": 0.5, "between": ("a.jpg", 1, 2, 3, 4)}, "between 1 and 10000"),
        ({"distance_mm": 100.0, "between": ("a.jpg", 1, 2, 3, 4), "paper": "a4"}, "give one of"),
    ],
)
def test_settings_that_contradict_each_other(settings, problem):
    with pytest.raises(UsageError, match=problem):
        PhotoSettings(**settings)


def test_stages_show_what_was_measured(tmp_path):
    mesh, camera, _ = wave_scan(1.0)
    scan = found_from(mesh, camera, None).acquired.scan
    settings = RestoreSettings(
        render=RenderSettings(dpi=40.0),
        shading=ShadingSettings(shading="none"),
        binarize=BinarizeSettings(binarize="none"),
        rotate="0",
    )
    done = restore(scan, settings)
    measured = (done.flattening.page_xy[:, 0] < done.flattening.size_mm[0] / 2).astype(float)
    assert tmp_path / "9-measured.png" in write_stages(tmp_path, done, measured)
    shown = read_photo(tmp_path / "9-measured.png").pixels
    rows, cols = shown.shape[:2]
    left, right = shown[rows // 2, cols // 4], shown[rows // 2, 6 * cols // 10]
    assert left[0] > 200  # yellow
    assert right[0] < 100  # dark blue


def test_two_places_of_a_known_distance():
    half = MarkedPlaces(np.array([[0, 1, 2], [1, 2, 3]]), np.array([[0.5, 0.5, 0], [0, 0, 1.0]]), 500.0)
    assert half.apart(np.array([[0.0, 0], [2, 0], [0, 2], [1, 4]])) == 4.0
