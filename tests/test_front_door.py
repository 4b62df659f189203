"""What the library takes and refuses: meshes, scans and their arrays; and what it gives back."""

import sys
from types import SimpleNamespace

import numpy as np
import pytest

import planish
from planish.errors import InputError, MissingExtraError, UsageError
from planish.gallery import sheet, virtual_scan
from planish.types import Camera, Mesh, Page, Scan, View
from shapes import arch, grid

UV, FACES = grid(8, 6)
POINTS = arch(UV)
PHOTO = np.arange(6 * 8 * 3, dtype=np.uint8).reshape(6, 8, 3)


def quads():
    """Nine quads on 16 points."""
    corner = np.arange(16).reshape(4, 4)[:-1, :-1].ravel()
    points = np.stack([np.arange(16) % 4 * 50.0, np.arange(16) // 4 * 50.0, np.zeros(16)], axis=1)
    return points, np.stack([corner, corner + 1, corner + 5, corner + 4], axis=1)


class Trimesh:
    """As trimesh and others have it."""

    def __init__(self, points, faces):
        self.vertices, self.faces = points, faces


class Open3D:
    """As Open3D's TriangleMesh has it."""

    def __init__(self, points, faces):
        self.vertices, self.triangles = points, faces


class Tensor:
    """As Open3D's tensors have it: no array until asked."""

    def __init__(self, values):
        self.values = values

    def numpy(self):
        return self.values


class Open3DTensors:
    """As Open3D's t.geometry.TriangleMesh has it."""

    def __init__(self, points, faces):
        self.vertex = SimpleNamespace(positions=Tensor(points))
        self.triangle = SimpleNamespace(indices=Tensor(faces))


class PyVista:
    """As PyVista's PolyData has it: each face begins with the number of its corners."""

    def __init__(self, points, faces):
        self.points, self.faces = points, np.insert(faces, 0, faces.shape[1], axis=1).ravel()


class TestMesh:
    @pytest.mark.parametrize("library", [Trimesh, Open3D, Open3DTensors, PyVista])
    def test_meshes_of_other_libraries_are_taken(self, library):
        mesh = Mesh(library(POINTS, FACES))
        assert np.array_equal(mesh.points, POINTS)
        assert np.array_equal(mesh.faces, FACES)

    def test_faces_of_pyvista_that_are_no_triangles_are_refused(self):
        points, faces = quads()
        mixed = PyVista(points, faces[:, :3])
        mixed.faces = np.r_[mixed.faces, 4, faces[0]]
        for given in (PyVista(points, faces), mixed):
            with pytest.raises(InputError, match=r"no triangles; triangles are wanted; call mesh.triangulate\(\)"):
                Mesh(given)

    @pytest.mark.parametrize("kind", [np.float64, np.float32, np.int64, np.int16])
    @pytest.mark.parametrize("index", [np.int32, np.int64, np.uint32, np.uint64])
    def test_real_points_and_whole_faces_are_taken(self, kind, index):
        mesh = Mesh(POINTS.astype(kind), FACES.astype(index))
        assert (mesh.points.dtype, mesh.faces.dtype) == (np.float64, np.int32)
        assert np.array_equal(mesh.faces, FACES)

    def test_lists_and_arrays_of_any_layout_are_taken(self):
        for points, faces in ((POINTS.tolist(), FACES.tolist()), (np.asfortranarray(POINTS), FACES[:, ::-1][:, ::-1])):
            mesh = Mesh(points, faces)
            assert np.array_equal(mesh.points, POINTS)
            assert mesh.points.flags.c_contiguous
            assert mesh.faces.flags.c_contiguous

    @pytest.mark.parametrize(
        ("points", "faces", "sentence"),
        [
            (*quads(), r"faces have the shape \(9, 4\); \(m, 3\) is wanted.*split each of these quads"),
            (POINTS.T, FACES, r"points have the shape \(3, \d+\); \(n, 3\) is wanted.*transpose"),
            (POINTS[:, :2], FACES, r"points have the shape \(\d+, 2\).*third coordinate"),
            (POINTS.ravel(), FACES, r"points have the shape \(\d+,\)"),
            (POINTS, FACES.T, r"faces have the shape \(3, \d+\).*transpose"),
            (POINTS, FACES.ravel(), r"faces have the shape \(\d+,\)"),
            (POINTS, FACES.astype(float), "faces are float64; whole numbers are wanted"),
            (POINTS, FACES + len(POINTS), r"face 0 uses point \d+, but there are"),
            (POINTS, FACES - 1, "uses point -1, but there are"),
            (POINTS, FACES.astype(np.int64) + 2**32, r"face 0 uses point \d{10}, but there are"),
            (POINTS, FACES.astype(np.uint64) + 2**63, r"face 0 uses point \d{19}, but there are"),
            (np.ma.masked_array(POINTS), FACES, "points came as a masked array.*fill it"),
            (POINTS, np.ma.masked_array(FACES), "faces came as a masked array"),
            (POINTS.astype(object), FACES, "points came as an array of object"),
            (POINTS, FACES.astype(object), "faces came as an array of object"),
            (POINTS.astype(complex), FACES, "points came as an array of complex128"),
            (POINTS.astype(str), FACES, "points came as an array of <U"),
            (POINTS, FACES > 3, "faces came as an array of bool"),
            ([[0, 0, 0], [1, 0]], FACES, "points came as rows of different lengths"),
            ("sheet.obj", FACES, "points came as a str"),
            (POINTS, None, "a ndarray was given and no faces"),
        ],
    )
    def test_anything_else_is_refused_in_one_sentence(self, points, faces, sentence):
        with pytest.raises(InputError, match=sentence) as caught:
            Mesh(points, faces)
        assert "\n" not in str(caught.value)
        with pytest.raises(ValueError, match=sentence):
            planish.flatten(points, faces)

    def test_what_has_vertices_and_faces_is_a_mesh(self):
        for mesh in (Mesh(Trimesh(POINTS, FACES)), Scan(Trimesh(POINTS, FACES)).mesh):
            assert np.array_equal(mesh.points, POINTS)
        with pytest.raises(InputError, match="split each of these quads"):
            Scan(Trimesh(*quads()))
        trimesh = pytest.importorskip("trimesh")
        solid = trimesh.Trimesh(POINTS.copy(), FACES.copy(), process=False)
        mesh = Mesh(solid)
        solid.vertices[0] = 7
        assert np.array_equal(mesh.points, POINTS)

    def test_changing_the_callers_array_changes_no_mesh(self):
        points, faces = POINTS.copy(), FACES.copy()
        readonly = points.view()
        readonly.flags.writeable = False  # but `points` may still be written to
        meshes = [Mesh(points, faces), Mesh(points[:], faces[:]), Mesh(readonly, faces)]
        points[:], faces[:] = 7, 0
        for mesh in meshes:
            assert np.array_equal(mesh.points, POINTS)
            assert np.array_equal(mesh.faces, FACES)
            with pytest.raises(ValueError, match="read-only"):
                mesh.points[0] = 0

    def test_arrays_that_nobody_can_change_are_not_copied(self):
        mesh = Mesh(POINTS, FACES)
        again = Mesh(mesh.points, mesh.faces)
        assert np.shares_memory(again.points, mesh.points)
        assert np.shares_memory(again.faces, mesh.faces)
        assert np.shares_memory(Mesh.owned(POINTS, FACES).points, POINTS)


class TestScan:
    @pytest.mark.parametrize(
        "photo", [PHOTO, PHOTO[..., 0], PHOTO.astype(np.uint16) * 200, PHOTO / 255, PHOTO[..., :1]]
    )
    def test_photos_of_every_usual_kind_are_taken(self, photo):
        scan = Scan(Mesh(POINTS, FACES), photo)
        assert scan.photo.shape == PHOTO.shape
        assert scan.photo.dtype == (np.uint8 if photo.dtype == np.uint8 else np.uint16)
        grey = photo if photo.ndim == 3 else photo[..., None]
        expected = grey * 65535 if photo.dtype == float else grey
        assert np.abs(scan.photo - expected.astype(float)).max() <= 0.5  # of rounding
        assert View(photo, None).photo.shape == PHOTO.shape

    @pytest.mark.parametrize(
        ("photo", "sentence"),
        [
            (PHOTO.astype(float), "float64 from 0 to 143; floats from 0 to 1 are wanted"),
            (PHOTO / 255 - 0.1, "floats from 0 to 1 are wanted"),
            (np.full((4, 4), np.nan), "floats from 0 to 1 are wanted"),
            (PHOTO.astype(np.int64), "the photo is int64"),
            (PHOTO > 3, "the photo came as an array of bool"),
            (np.dstack([PHOTO, PHOTO[..., :1]]), r"the shape \(6, 8, 4\).*leave out the alpha channel"),
            (PHOTO.transpose(2, 0, 1), r"the shape \(3, 6, 8\).*put the channels last"),
            (PHOTO[None], r"the shape \(1, 6, 8, 3\)"),
            (PHOTO[:0], r"the shape \(0, 8, 3\)"),
            (np.ma.masked_array(PHOTO), "masked array"),
            (PHOTO.astype(object), "array of object"),
        ],
    )
    def test_anything_else_is_no_photo(self, photo, sentence):
        for make in (lambda: Scan(Mesh(POINTS, FACES), photo), lambda: View(photo, None)):
            with pytest.raises(InputError, match=sentence):
                make()

    def test_places_per_point_or_per_corner_also_as_lists(self):
        mesh, per_point = Mesh(POINTS, FACES), POINTS[:, :2]
        for places in (per_point, per_point.tolist(), per_point[FACES], per_point[FACES].tolist()):
            scan = Scan(mesh, PHOTO, places)
            assert scan.photo_xy.dtype == np.float64
            assert np.array_equal(scan.photo_xy, places)

    @pytest.mark.parametrize("places", [POINTS, POINTS[1:, :2], POINTS[:, :2].T, POINTS[:, :2].astype(str), [1, 2]])
    def test_other_places_are_refused(self, places):
        with pytest.raises(InputError, match="photo_xy"):
            Scan(Mesh(POINTS, FACES), PHOTO, places)

    def test_changing_the_callers_arrays_changes_no_value(self):
        photo, places, known, matrix = PHOTO.copy(), POINTS[:, :2].copy(), np.ones((6, 8), bool), np.eye(3)
        scan = Scan(Mesh(POINTS, FACES), photo, places)
        page, view = Page(photo, known, 100.0), View(photo, None)
        camera = Camera(matrix, matrix, matrix[0], (6, 8))
        for array in (photo, places, known, matrix):
            array[:] = 0
        for pixels in (scan.photo, page.pixels, view.photo):
            assert np.array_equal(pixels, PHOTO)
        assert np.array_equal(scan.photo_xy, POINTS[:, :2])
        assert page.known.all()
        assert np.array_equal(camera.matrix, np.eye(3))


class TestFlatten:
    @pytest.mark.parametrize(("units", "mm"), [("mm", 1), ("cm", 10), ("m", 1000), ("in", 25.4)])
    def test_points_in_any_unit(self, units, mm):
        expected = planish.flatten(POINTS, FACES)
        flat = planish.flatten(POINTS / mm, FACES, units=units)
        # both end within the solver's tolerance of the same sheet
        assert flat.size_mm == pytest.approx(expected.size_mm, rel=1e-6)

    @pytest.mark.parametrize("units", ["auto", "parsec", 2.0])
    def test_units_that_cannot_be(self, units):
        with pytest.raises(UsageError, match="mm, cm, m, in or a length"):
            planish.flatten(POINTS, FACES, units=units)

    def test_a_mesh_is_in_mm(self):
        with pytest.raises(UsageError, match="a Mesh is in mm"):
            planish.flatten(Mesh(POINTS, FACES), units="cm")
        with pytest.raises(UsageError, match="faces beside it"):
            planish.flatten(Mesh(POINTS, FACES), FACES)

    def test_a_viewpoint_is_three_finite_numbers(self):
        assert Scan(Mesh(POINTS, FACES), viewpoint=[0, 0, 500]).viewpoint.dtype == np.float64
        for viewpoint in ([0, 0], [0, 0, np.inf], "above"):
            with pytest.raises(InputError, match="the viewpoint"):
                planish.flatten(POINTS, FACES, viewpoint=viewpoint)

    def test_a_mesh_of_another_library_is_flattened(self):
        assert len(planish.flatten(Trimesh(POINTS, FACES)).page_xy) == len(POINTS)

    def test_progress_is_told_as_restore_tells_it(self):
        told = []
        planish.flatten(POINTS, FACES, progress=lambda stage, share: told.append((stage, share)))
        assert [stage for stage, share in told if share == 0.0][:1] == ["clean"]
        assert {stage for stage, _ in told} == {"clean", "flatten", "turn"}
        assert all(0 <= share <= 1 for _, share in told)

    def test_uv_is_the_page_with_v_up(self):
        flat = planish.flatten(POINTS, FACES)
        assert np.array_equal(flat.uv[:, 0], flat.page_xy[:, 0])
        assert flat.uv[:, 1] == pytest.approx(flat.size_mm[1] - flat.page_xy[:, 1])
        u, v = flat.uv[FACES[:, 1]] - flat.uv[FACES[:, 0]], flat.uv[FACES[:, 2]] - flat.uv[FACES[:, 0]]
        assert (u[:, 0] * v[:, 1] - u[:, 1] * v[:, 0] > 0).all()  # the printed side is seen: counter-clockwise


@pytest.fixture(scope="module")
def done():
    scan = virtual_scan(sheet("book"), points=3000, photo_px=(600, 450)).scan
    return planish.restore(Scan(scan.mesh, scan.photo, scan.photo_xy, scan.camera, icc=b"profile " * 400))


class TestRestoration:
    @pytest.mark.slow
    def test_the_page_is_the_best_there_is(self, done):
        assert done.page is done.unshaded
        plain = planish.RestoreSettings(shading=planish.settings.ShadingSettings(shading="none"))
        source = done.prepared.source
        rendered = planish.restore(source, plain)
        assert rendered.page is rendered.rendered
        assert planish.restore(Scan(source.mesh)).page is None

    @pytest.mark.slow
    def test_binarization_waits_until_it_is_looked_at_and_is_done_once(self, monkeypatch):
        from planish.pipeline import restore as module

        calls = []
        monkeypatch.setattr(
            sys.modules["planish.pipeline.restore"], "binarize", lambda page, s: calls.append(s) or page
        )
        scan = virtual_scan(sheet("book"), points=3000, photo_px=(600, 450)).scan
        made = module(scan)
        assert calls == []
        assert made.binary is made.binary is made.page
        assert len(calls) == 1
        assert "binarize" not in made.report.seconds

    def test_what_is_printed_is_one_short_line(self, done):
        source = done.prepared.source
        for value in (
            *(done, done.flattening, done.report, done.page, source, source.mesh, source.camera, done.prepared),
            View(PHOTO, source.camera),
        ):
            assert "\n" not in repr(value)
            assert len(repr(value)) < 300
            assert "profile profile" not in repr(value)

    def test_what_files_gave_is_one_line_too(self, done, tmp_path):
        planish.write_scan(tmp_path / "scan.ply", done.prepared.source)
        found = planish.read_scan(tmp_path / "scan.ply")
        photo = planish.read_photo(next(p for p in tmp_path.iterdir() if p.suffix in (".png", ".jpg", ".tif")))
        for value in (found, photo):
            assert "\n" not in repr(value)
            assert len(repr(value)) < 500


class TestPlot:
    @pytest.fixture(autouse=True)
    def _no_window(self):
        matplotlib = pytest.importorskip("matplotlib")
        matplotlib.use("Agg")
        yield
        matplotlib.pyplot.close("all")

    def test_a_flattening_in_colours_over_its_millimetres(self, done):
        for values in ("error", "strain"):
            ax = done.flattening.plot(values)
            (image,) = ax.images
            assert image.get_extent() == pytest.approx([0, done.flattening.size_mm[0], done.flattening.size_mm[1], 0])
            known = image.get_array().compressed()
            at_points = done.flattening.error_mm if values == "error" else 100 * done.flattening.local_strain
            assert at_points.min() <= known.min() <= known.max() <= at_points.max()  # means of points
        with pytest.raises(UsageError, match="error and strain"):
            done.flattening.plot("colour")

    def test_into_axes_that_are_there(self, done):
        from matplotlib import pyplot

        _, ax = pyplot.subplots()
        assert done.page.plot(ax) is ax
        assert done.flattening.plot(ax=ax) is ax

    def test_a_restoration_beside_the_maps_of_its_report(self, done):
        titles = [ax.get_title() for ax in done.plot().axes if ax.images and ax.get_title()]
        assert titles == ["page", "expected error [mm]", "strain [%]", "photo pixels per inch of page"]
        alone = planish.restore(Scan(done.prepared.source.mesh)).plot()
        assert [ax.get_title() for ax in alone.axes if ax.get_title()] == ["expected error [mm]", "strain [%]"]

    def test_without_matplotlib_one_sentence_says_what_to_install(self, done, monkeypatch):
        monkeypatch.setitem(sys.modules, "matplotlib", None)
        with pytest.raises(MissingExtraError, match="pip install 'matplotlib"):
            done.flattening.plot()


@pytest.mark.parametrize("paper", ["a4", (210,), (210, -297), (210, np.nan), 210])
def test_sides_of_paper_are_two_numbers_above_zero(paper):
    with pytest.raises(InputError, match="two sides in mm, above 0"):
        Scan(Mesh([[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 2]]), paper_mm=paper)
