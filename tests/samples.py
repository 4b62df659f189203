"""Small scan files for the tests of reading and writing."""

import numpy as np
from PIL import Image

from planish.types import Camera, Mesh, Scan
from shapes import arch, grid


def picture(rows=40, cols=60, channels=3, dtype=np.uint8):
    """A smooth picture in which every pixel differs from its neighbours, so that turns and shifts show."""
    r, c = np.meshgrid(np.linspace(0, 1, rows), np.linspace(0, 1, cols), indexing="ij")
    planes = [r, c, 0.5 * (1 - r) + 0.2 * c, 1 - c][:channels]
    top = np.iinfo(dtype).max
    return np.stack(planes, axis=-1).dot(top).round().astype(dtype)


def camera_above(rows=40, cols=60):
    """A camera over the arch, looking down, the top of the photo towards +y."""
    matrix = np.array([[100.0, 0, (cols - 1) / 2], [0, 100.0, (rows - 1) / 2], [0, 0, 1]])
    return Camera(matrix, np.diag([1.0, -1.0, -1.0]), np.array([0.0, 140.0, 400.0]), (rows, cols))


def sheet_scan(rows=7, cols=5, **kw):
    """A bent sheet with a photo that was laid on it straight: photo places grow with the flat places."""
    uv, faces = grid(rows, cols)
    photo = picture()
    places = np.stack([uv[:, 0] / 200 * 50 + 4, 34 - uv[:, 1] / 280 * 30], axis=1)
    return Scan(Mesh(arch(uv), faces), **{"photo": photo, "photo_xy": places, **kw})


def obj_text(scan, photo_name="photo.png"):
    """An OBJ as a scanner's software may write it, with an MTL to go with it."""
    rows, cols = scan.photo.shape[:2]
    lines = ["# a sheet", "mtllib sheet.mtl", "usemtl page"]
    lines += [f"v {x:.6f} {y:.6f} {z:.6f}" for x, y, z in scan.mesh.points]
    lines += [f"vt {(x + 0.5) / cols:.8f} {1 - (y + 0.5) / rows:.8f}" for x, y in scan.photo_xy]
    lines += ["f " + " ".join(f"{i}/{i}" for i in face) for face in scan.mesh.faces + 1]
    return "\n".join(lines) + "\n", f"newmtl page\nmap_Kd {photo_name}\n"


def write_obj_by_hand(folder, scan):
    """The files of `obj_text`, and the photo as PNG."""
    obj, mtl = obj_text(scan)
    (folder / "sheet.obj").write_text(obj)
    (folder / "sheet.mtl").write_text(mtl)
    Image.fromarray(scan.photo).save(folder / "photo.png")
    return folder / "sheet.obj"
