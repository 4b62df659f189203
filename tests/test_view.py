"""The HTML view as a file: its contents, and that they are escaped."""

import base64
import gzip
import hashlib
import json
import re
import shutil
import subprocess
from dataclasses import replace
from html.parser import HTMLParser
from io import BytesIO
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

import planish
from planish.flattening import simulate_verlet
from planish.gallery import sheet, sheet_mesh, virtual_scan
from planish.mesh import Coarse, area_vectors, onto_support_plane, prolongate, topology
from planish.settings import RestoreSettings
from planish.sticks import make_sticks
from planish.types import Diagnostic, Mesh, Outcome, Page, Scan
from planish.view import view_page
from planish.view.fall_animation import select_keyframes, simulate_fall
from planish.view.page_layers import MAX_BYTES, page_pictures
from planish.view.report_html import animation_caption
from shapes import arch, grid

VIEW = Path(planish.__file__).parent / "view"
HOSTILE = """</script><script>alert(1)</script>"'><img src=x onerror=alert(2)>&amp;${name}"""


class Document(HTMLParser):
    """Elements of a page: (tag, attributes), text of scripts and styles, all other text."""

    def __init__(self, page):
        super().__init__()
        self.elements, self.raw, self.text = [], {"script": [], "style": []}, ""
        self.feed(page.decode())

    def handle_starttag(self, tag, attrs):
        self.elements.append((tag, dict(attrs)))

    def handle_data(self, data):
        if self.lasttag in self.raw:
            self.raw[self.lasttag].append(data)
        else:
            self.text += data

    def handle_endtag(self, tag):
        self.lasttag = ""

    @property
    def data(self):
        return json.loads(self.raw["script"][0])

    def picture(self, name):
        (found,) = (a["src"] for tag, a in self.elements if a.get("id") == f"picture-{name}")
        return np.asarray(Image.open(BytesIO(base64.b64decode(found.partition("base64,")[2]))))


def unpacked(text, dtype):
    return np.frombuffer(gzip.decompress(base64.b64decode(text)), dtype)


def states_of(data):
    """Points [mm] in every state, decoded as by the page's script."""
    fall = data["animation"]
    moves = unpacked(fall["moves"], "<i2").reshape(fall["states"], fall["points"], 3)
    return np.cumsum(moves, axis=0, dtype=np.int16) * np.array(fall["step"]) + fall["low"]


@pytest.fixture(scope="module")
def scan(book_scan):
    return book_scan.scan


@pytest.fixture(scope="module")
def done(restored_book):
    return restored_book


@pytest.fixture(scope="module")
def page(scan, done):
    return view_page(done, "a book.obj")


@pytest.fixture(scope="module")
def document(page):
    return Document(page)


@pytest.mark.slow
def test_it_is_self_contained(page, document):
    assert len(page) < 15e6
    links = [
        value for _, attributes in document.elements for key, value in attributes.items() if key in ("src", "href")
    ]
    assert links
    assert all(link.startswith("data:") for link in links)
    assert not re.search(r"url\(|@import", document.raw["style"][0])
    assert [tag for tag, _ in document.elements if tag in ("iframe", "object", "embed", "base", "form")] == []


@pytest.mark.slow
def test_its_policy_allows_this_script_and_style_only(document):
    (policy,) = (a["content"] for _, a in document.elements if a.get("http-equiv") == "Content-Security-Policy")
    rules = dict(rule.strip().split(" ", 1) for rule in policy.split(";"))

    def digest(text):
        return f"'sha256-{base64.b64encode(hashlib.sha256(text.encode()).digest()).decode()}'"

    assert rules["default-src"] == "'none'"
    assert rules["script-src"] == digest(document.raw["script"][1])
    assert rules["style-src"] == digest(document.raw["style"][0])
    assert rules["img-src"] == "data:"


def test_the_first_state_is_the_scan_and_the_last_is_the_page(scan, done, document):
    data = document.data
    states = states_of(data)
    bent, flat = states[0], states[-1]
    at = np.round((flat[:, :2] * [1, -1] + np.array(data["size"]) / 2), 2)
    nearest = np.array([np.argmin(((done.flattening.page_xy - place) ** 2).sum(axis=1)) for place in at])
    # To the nearest point of the page it is at most the step of a 16-bit number, 0.005 mm, and the rounding above.
    assert np.abs(done.flattening.page_xy[nearest] - at).max() < 0.02
    assert np.abs(flat[:, 2]).max() < 0.01
    one, other = np.random.default_rng(1).integers(0, len(bent), (2, 500))
    apart = np.linalg.norm(bent[one] - bent[other], axis=1)
    truth = scan.mesh.points[nearest]
    # Its points were not moved against each other: off by rounding alone, of two ends.
    np.testing.assert_allclose(apart, np.linalg.norm(truth[one] - truth[other], axis=1), atol=0.02)
    faces = unpacked(data["animation"]["faces"], "<u4")
    assert set(np.unique(faces)) == set(range(len(bent)))


def test_heights_decrease_to_zero(document):
    heights = document.data["animation"]["heights"]
    assert heights[0] == pytest.approx(states_of(document.data)[0, :, 2].max(), abs=0.5)  # noise of the scan
    assert heights[0] > 20
    assert heights[-1] == 0
    assert heights == sorted(heights, reverse=True)  # nothing holds up a page of a book


def test_images_have_the_aspect_ratio_of_the_page(document):
    width, height = document.data["size"]
    margin = document.data["margin"]
    for layer in document.data["layers"]:
        if layer["kind"] == "picture":
            rows, cols = document.picture(layer["name"]).shape[:2]
            around = 2 * margin if layer["withMargin"] else 0
            assert max(rows, cols) <= 2000
            assert cols / rows == pytest.approx((width + around) / (height + around), rel=0.002)  # a pixel of 600


def test_maps_have_the_measured_values(done, document):
    flat = done.flattening
    layers = {layer["name"]: layer for layer in document.data["layers"] if layer["kind"] == "map"}
    assert list(layers) == ["strain", "ppi", "error"]
    for name, values in {"strain": 100 * flat.local_strain, "error": flat.error_mm}.items():
        layer = layers[name]
        codes = unpacked(layer["values"], "u1").reshape(layer["rows"], layer["cols"]).astype(float)
        codes[codes == 255] = np.nan
        shown = layer["low"] + (layer["high"] - layer["low"]) * codes / 254
        col, row = (flat.page_xy / flat.size_mm * [layer["cols"], layer["rows"]]).astype(int).T
        inside = (row > 0) & (col > 0) & (row < layer["rows"] - 1) & (col < layer["cols"] - 1)
        off = shown[row[inside], col[inside]] - np.minimum(values[inside], layer["high"])
        # Half a pixel of the map beside the point, where neighbours differ by a few percent of the scale.
        assert np.nanmedian(np.abs(off)) < 0.05 * layer["high"]
        assert np.isfinite(off).mean() > 0.95  # the border of a coarse scan is ragged


def test_the_report_is_text(done, document):
    report = done.report
    assert report.outcome in document.text
    assert f"{report.page.width_mm:.1f} × {report.page.height_mm:.1f} mm" in document.text
    assert f"{report.flatten.expected_error_mm:.3f} mm (rms)" in document.text
    assert report.guideline.name in document.text


@pytest.mark.slow
@pytest.mark.parametrize("quarter", [0, 1])
def test_a_photo_of_a_flat_sheet_is_aligned_with_its_page(quarter):
    """In every orientation of the camera."""
    uv, faces = grid(29, 21, 200.0, 280.0)
    rng = np.random.default_rng(5)
    photo = np.kron(rng.integers(0, 255, (35, 25, 3), np.uint8), np.ones((20, 20, 1), np.uint8))
    rows, cols = photo.shape[:2]
    places = np.c_[uv[:, 0] / 200 * cols, (1 - uv[:, 1] / 280) * rows] - 0.5
    for _ in range(quarter):
        photo, places = np.rot90(photo), np.c_[places[:, 1], photo.shape[1] - 1 - places[:, 0]]
    scan = Scan(Mesh(np.c_[uv, np.zeros(len(uv))], faces), photo, places)
    document = Document(view_page(planish.restore(scan, RestoreSettings(rotate="0"))))
    warped, restored = document.picture("warped").astype(float), document.picture("restored").astype(float)
    data = document.data
    margin = round(data["margin"] * warped.shape[1] / (data["size"][0] + 2 * data["margin"]))
    cut = Image.fromarray(warped[margin:-margin, margin:-margin].astype(np.uint8))
    fitted = np.asarray(cut.resize(restored.shape[1::-1])).astype(float)
    # Fields of 8 mm: their borders are blurred by two ways of drawing and a pixel of rounding, the rest is the same.
    assert np.median(np.abs(fitted - restored)) < 4


@pytest.mark.slow
def test_a_texture_atlas_is_not_a_photo(scan):
    """The sheet seen from above is shown instead."""
    uv, faces = grid(29, 21, 200.0, 280.0)
    half = (uv[:, 0] < 100) != (uv[:, 1] < 140)
    places = np.c_[(uv[:, 0] + np.where(half, 100, 0)) % 200, 280 - uv[:, 1]] * 2
    corners = places[faces]
    far = np.ptp(corners, axis=1).max(axis=1) > 100
    corners[far] = corners[far][:, :1]  # faces across a seam
    patches = Scan(Mesh(arch(uv), faces), np.full((560, 400, 3), 200, np.uint8), corners)
    layers = Document(view_page(planish.restore(patches))).data["layers"]
    assert layers[0]["title"] == "From above"


@pytest.mark.slow
def test_hostile_text_is_escaped(scan, done):
    loaded = replace(
        done, report=replace(done.report, warnings=[Diagnostic("hostile", HOSTILE)], sources={HOSTILE: HOSTILE})
    )
    found = Document(view_page(loaded, HOSTILE))
    plain = Document(view_page(done, "x"))
    assert found.text.count(HOSTILE) == 5  # title, heading, warning, and both halves of the source
    kinds = [tag for tag, _ in found.elements]
    assert kinds.count("script") == 2
    assert kinds.count("img") == [tag for tag, _ in plain.elements].count("img")
    assert not [key for _, attributes in found.elements for key in attributes if key.startswith("on")]


def test_a_scan_without_a_photo_shows_its_shape():
    mesh, _ = sheet_mesh(sheet("wave"), points=900, layout="grid")
    document = Document(view_page(planish.restore(Scan(mesh)), "a mesh"))
    assert [layer["name"] for layer in document.data["layers"]] == ["strain", "error"]
    assert [tag for tag, _ in document.elements].count("img") == 0
    assert states_of(document.data).shape[1] == len(mesh.points)  # all of a small scan


@pytest.mark.parametrize("height", [0.0, 30.0])
def test_the_smallest_of_sheets_can_be_viewed(height):
    """Two triangles, flat or with a fold between them; the file name is not valid text."""
    points = np.array([[0.0, 0, 0], [100, 0, height], [100, 100, 0], [0, 100, height]])
    scan = Scan(Mesh(points, np.array([[0, 1, 2], [0, 2, 3]], np.int32)))
    document = Document(view_page(planish.restore(scan), "scan\udcff.obj"))
    assert states_of(document.data).shape[1] == 4
    assert "scan?.obj" in document.text


@pytest.mark.slow
def test_a_spread_shows_where_it_is_split():
    scan = virtual_scan(sheet("spread"), points=2500, photo_px=(600, 450)).scan
    done = planish.restore(scan, RestoreSettings(pages="2"))
    document = Document(view_page(done, "a spread"))
    assert document.data["spine"] == done.report.spine.x_mm
    assert "two pages" in document.text


def test_an_image_full_of_noise_stays_within_the_size_limit(done):
    noise = np.random.default_rng(2).integers(0, 255, (2400, 2400, 3), np.uint8)
    loud = replace(done, rendered=Page(noise, np.ones(noise.shape[:2], bool), 300.0), unshaded=None, make_binary=None)
    (picture,) = page_pictures(loud)
    assert len(picture.data) < MAX_BYTES


@pytest.mark.parametrize("outcome", Outcome)
def test_the_caption_names_the_outcome_of_the_simulation(done, outcome):
    mesh, _ = sheet_mesh(sheet("wave"), points=400, layout="grid")
    flat = planish.flatten(mesh)
    fall = simulate_fall(mesh, topology(mesh.faces, len(mesh.points)), flat.page_xy, flat.size_mm)
    assert fall.outcome is Outcome.SETTLED
    said = {end: animation_caption(done, replace(fall, outcome=end)) for end in Outcome}
    assert len(set(said.values())) == len(Outcome)
    assert f"{len(mesh.points)} points of the sheet" in said[outcome]
    assert "flattened by multigrid" in said[outcome]


def test_recording_states_does_not_change_the_simulation():
    mesh, _ = sheet_mesh(sheet("wave"), points=300, layout="grid")
    sticks = make_sticks(mesh, topology(mesh.faces, len(mesh.points)), "unfolded")
    standing = Mesh(onto_support_plane(mesh)[0], mesh.faces)
    seen = []
    watched, alone = simulate_verlet(standing, sticks, watch=seen.append), simulate_verlet(standing, sticks)
    np.testing.assert_array_equal(watched.points, alone.points)
    np.testing.assert_allclose(seen[0], standing.points, rtol=1e-12)  # the kernel has units of its own
    np.testing.assert_array_equal(seen[-1], alone.points)
    assert len(seen) == len(alone.residuals) + 2  # before the first step, and when it was let go


@pytest.mark.slow
def test_interpolation_reproduces_rigid_motions():
    """Also for fine points off the coarse faces."""
    uv, faces = grid(9, 7)
    coarse = arch(uv)
    rng = np.random.default_rng(3)
    corner = faces[rng.integers(0, len(faces), 200)]
    weight = rng.dirichlet(np.ones(3), 200)
    fine = np.einsum("pk,pkd->pd", weight, coarse[corner]) + rng.normal(0, 0.5, (200, 3))
    turn = np.linalg.qr(rng.normal(size=(3, 3)))[0]
    turn *= np.sign(np.linalg.det(turn))
    upright = area_vectors(coarse, faces)
    upright /= np.linalg.norm(upright, axis=1, keepdims=True)
    moved = prolongate(Coarse(Mesh(coarse, faces), corner[:, 0]), fine, coarse @ turn.T + 7, upright @ turn.T)
    np.testing.assert_allclose(moved, fine @ turn.T + 7, atol=1e-9)


@pytest.mark.parametrize("most", [3, 10, 40])
def test_keyframes_are_at_about_equal_distances(most):
    way = np.cumsum(np.r_[0, np.random.default_rng(4).random(200) ** 4])
    history = (way[:, None, None] * np.ones((1, 5, 3))).astype(np.float32)
    kept = select_keyframes(history, most)
    assert 2 <= len(kept) <= most
    assert (kept[0], kept[-1]) == (0, 200)
    steps = np.diff(way[kept])
    # One state further would have been nearer than the distance that was asked for, so none is much longer.
    assert steps.max() < 2 * way[-1] / (len(kept) - 1) + np.diff(way).max()


def sources_of_the_bundle():
    web = VIEW / "web"
    return [web / "package-lock.json", web / "tsconfig.json", web / "build.mjs", *sorted((web / "src").iterdir())]


def test_the_bundle_is_made_from_these_sources():
    digest = hashlib.sha256(b"".join(path.read_bytes() for path in sources_of_the_bundle())).hexdigest()
    assert f"sources {digest}" in (VIEW / "static" / "view.js").read_text()[:200], "run: make view"


def test_the_bundle_contains_the_licence_of_three():
    bundle = (VIEW / "static" / "view.js").read_text()
    assert "three.js authors" in bundle[:2000]
    assert "The above copyright notice and this permission notice shall be included" in " ".join(bundle[:2000].split())


@pytest.mark.slow
def test_the_build_is_reproducible(tmp_path):
    """Where `make view` has filled npm's cache; elsewhere the test above holds the sources and the bundle together."""
    if shutil.which("npm") is None:
        pytest.skip("there is no npm here")
    for name in ("package.json", "package-lock.json", "tsconfig.json", "build.mjs", "src"):
        copy = shutil.copytree if (VIEW / "web" / name).is_dir() else shutil.copy
        copy(VIEW / "web" / name, tmp_path / name)
    npm = ["npm", "ci", "--omit=dev", "--ignore-scripts", "--no-audit", "--no-fund", "--offline"]
    installed = subprocess.run(npm, cwd=tmp_path, capture_output=True)
    if installed.returncode:
        pytest.skip(f"run `make view` once, so that npm has the packages: {installed.stderr.decode()[-200:]}")
    subprocess.run(["node", "build.mjs", "view.js"], cwd=tmp_path, check=True)
    assert (tmp_path / "view.js").read_bytes() == (VIEW / "static" / "view.js").read_bytes(), "run: make view"
