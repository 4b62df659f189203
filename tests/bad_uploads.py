"""Uploads that no service should take: what is sent, and how it must be answered."""

import io
import struct
import zipfile
import zlib

OBJ = b"mtllib scan.mtl\nv 0 0 0\nv 200 0 0\nv 200 100 0\nvt 0 0\nvt 1 0\nvt 1 1\nusemtl m\nf 1/1 2/2 3/3\n"
MTL = b"newmtl m\nmap_Kd scan.png\n"


def png(width=20, height=10):
    """An image whose header says so many pixels, whatever it holds."""

    def chunk(kind, data):
        return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))

    head = struct.pack(">IIBBBBB", width, height, 8, 2, 0, 0, 0)
    data = zlib.compress(b"\0" * (1 + 3 * 20) * 10)
    return b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", head) + chunk(b"IDAT", data) + chunk(b"IEND", b"")


def zipped(*entries, method=zipfile.ZIP_DEFLATED):
    """A zip of (name or ZipInfo, data)."""
    file = io.BytesIO()
    with zipfile.ZipFile(file, "w", method) as archive:
        for name, data in entries:
            archive.writestr(name, data)
    return file.getvalue()


def special(mode):
    """An entry that is no plain file: 0o120000 for a symbolic link."""
    entry = zipfile.ZipInfo("scan.obj")
    entry.external_attr = (mode | 0o777) << 16
    return entry


def renamed(old, new):
    """A zip whose entry is called what Python would not write."""
    assert len(old) == len(new)
    return zipped((old, OBJ)).replace(old.encode(), new)


def locked():
    data = bytearray(zipped(("scan.obj", OBJ)))
    data[6] |= 1  # the local header's flag, and the list's
    data[data.index(b"PK\x01\x02") + 8] |= 1
    return bytes(data)


def lying_about_its_size():
    data = bytearray(zipped(("scan.obj", OBJ * 100)))
    at = data.index(b"PK\x01\x02") + 24
    data[at : at + 4] = struct.pack("<I", 10)
    return bytes(data)


GOOD = [("scan", ("scan.obj", OBJ)), ("scan", ("scan.mtl", MTL)), ("scan", ("scan.png", png()))]
SCAN = [("scan", ("scan.obj", OBJ))]


def one_zip(data):
    return [("scan", ("scan.zip", data))]


def broken(old, new):
    """A zip in which some bytes are others."""
    return one_zip(zipped(("scan.obj", OBJ)).replace(old, new, 1))


PHOTO = [("scan", ("scan.png", png()))]

BAD = {  # name: (files, fields, status, a part of the sentence)
    "no scan": ([("photo", ("photo.png", png()))], {}, 422, "no scan was sent"),
    "no mesh": ([("scan", ("scan.mtl", MTL))], {}, 422, "no mesh is among the files"),
    "no unit": ([*SCAN], {"units": "parsec"}, 422, "a length such as 7.91um"),
    "one photo, a marker": (PHOTO, {"marker-mm": "40"}, 422, "one photo does not show how large"),
    "two corners": (PHOTO, {"outline": "9x9 1,1 2,2"}, 422, "outline must have 3 to 60 corners"),
    "no outline": (PHOTO, {"outline": "the left"}, 422, "outline must be the photo's size"),
    "corner outside": (PHOTO, {"outline": "9x9 1,1 9,1 9,10"}, 422, "within the photo"),
    "huge outline": (PHOTO, {"outline": f"9x{10**99} 1,1 9,1 9,9"}, 422, "sides of 1 to 100000"),
    "no view": (SCAN, {"cut": "9x9 1,1 9,1 9,9"}, 422, "cut must be the view's size"),
    "cut twice": (
        SCAN,
        {"cut": "9x9 1,0,0,0 0,1,0,0 1,1 9,1 9,9", "outline": "9x9 1,1 9,1 9,9"},
        422,
        "outline and cut both say",
    ),
    "one place": (PHOTO, {"distance-mm": "9", "between": "a.png,1,2"}, 422, "between must name"),
    "no HEIC": ([("scan", ("a.heic", b"x")), ("scan", ("b.png", png()))], {}, 415, "not a readable image"),
    "two cameras files, two photos": (
        [*[("scan", (f"{k}.png", png())) for k in range(2)], *[("camera", (f"{k}.json", b"{}")) for k in range(2)]],
        {},
        422,
        "2 files of cameras were sent",
    ),
    "two meshes": ([*SCAN, ("scan", ("other.ply", b"ply\n"))], {}, 422, "2 meshes are"),
    "an empty file": ([("scan", ("scan.obj", b""))], {}, 422, "empty"),
    "a program": ([("scan", ("run.exe", b"MZ"))], {}, 415, "unsupported file type"),
    "no suffix": ([("scan", ("scan", OBJ))], {}, 415, "unsupported file type"),
    "an image called OBJ": ([("scan", ("scan.obj", png()))], {}, 415, "file type of a text"),
    "text called PLY": ([("scan", ("scan.ply", OBJ))], {}, 415, "not a valid PLY"),
    "text called GLB": ([("scan", ("scan.glb", OBJ))], {}, 415, "not a valid GLB"),
    "text called glTF": ([("scan", ("scan.gltf", OBJ))], {}, 415, "not a valid GLTF"),
    "text called image": ([*SCAN, ("scan", ("scan.jpg", OBJ))], {}, 415, "not a readable image"),
    "a huge image": ([*SCAN, ("scan", ("scan.png", png(100_000, 100_000)))], {}, 413, "10000 megapixels"),
    "a huge photo": ([*SCAN, ("photo", ("scan.png", png(100_000, 100_000)))], {}, 413, "10000 megapixels"),
    "a mesh as photo": ([*SCAN, ("photo", ("photo.obj", OBJ))], {}, 415, "not an image"),
    "an image as camera": ([*SCAN, ("camera", ("camera.png", png()))], {}, 415, "not a JSON file"),
    "two cameras, one photo": (
        [*SCAN, ("photo", ("a.png", png())), *[("camera", (f"{k}.json", b"{}")) for k in range(2)]],
        {},
        422,
        "1 photos but 2 cameras",
    ),
    "names twice": ([*SCAN, *SCAN], {}, 422, "two files are called"),
    "up and away": ([("scan", ("../../scan.obj", OBJ))], {}, 422, "not a plain file name"),
    "an absolute name": ([("scan", ("/etc/scan.obj", OBJ))], {}, 422, "not a plain file name"),
    "a name of another system": ([("scan", ("..\\scan.obj", OBJ))], {}, 422, "not a plain file name"),
    "a drive": ([("scan", ("C:scan.obj", OBJ))], {}, 422, "not a plain file name"),
    "a hidden name": ([("scan", (".scan.obj", OBJ))], {}, 422, "not a plain file name"),
    "a name that turns round": ([("scan", ("scan\u202egpj.obj", OBJ))], {}, 422, "not a plain file name"),
    "an endless name": ([("scan", ("s" * 200 + ".obj", OBJ))], {}, 422, "not a plain file name"),
    "too many files": ([("scan", (f"{k}.png", png())) for k in range(21)], {}, 413, "the limit is 20"),
    "too many bytes": ([("scan", ("scan.obj", OBJ * 20_000))], {}, 413, "the limit of 1 MB"),
    "another field with a file": ([("mesh", ("scan.obj", OBJ))], {}, 422, "files are accepted as"),
    "a scan as text": (None, {"scan": "v 0 0 0"}, 422, "must be a file, not text"),
    "an unknown setting": (GOOD, {"dpis": "300"}, 422, "there is no setting 'dpis'"),
    "a word for a number": (GOOD, {"dpi": "fine"}, 422, "dpi is 'fine'; expected a number or auto"),
    "no finite number": (GOOD, {"verlet.gravity": "inf"}, 422, "a finite number"),
    "a number out of range": (GOOD, {"dpi": "1000000"}, 422, "between 1 and 10000"),
    "another word": (GOOD, {"rotate": "45"}, 422, "auto or 0 or 90"),
    "another format": (GOOD, {"formats": "tif,gif"}, 422, "expected tif or png or jpg or pdf"),
    "an endless value": (GOOD, {"dpi": "9" * 2000}, 413, "longer than"),
    "no zip": (one_zip(OBJ), {}, 415, "is not a zip file"),
    "an empty zip": (one_zip(zipped()), {}, 422, "contains no file"),
    "a zip cut short": (one_zip(zipped(("scan.obj", OBJ))[:-30]), {}, 415, "is not a zip file"),
    "a zip with a broken list": (broken(b"PK\x01\x02", b"PK\x01\x09"), {}, 422, "damaged"),
    "a zip with broken content": (broken(b"scan.obj", b"scon.obj"), {}, 422, "damaged"),
    "a zip and a file": ([*one_zip(zipped(("scan.obj", OBJ))), *SCAN], {}, 422, "sent with other files"),
    "a zip in a zip": (one_zip(zipped(("a.zip", zipped(("scan.obj", OBJ))))), {}, 422, "another zip"),
    "a zip without a mesh": (one_zip(zipped(("readme.txt", b"hello"))), {}, 422, "no mesh"),
    "a zip that leads out": (one_zip(zipped(("../scan.obj", OBJ))), {}, 422, "a path outside of it"),
    "a zip to the root": (one_zip(zipped(("/tmp/scan.obj", OBJ))), {}, 422, "a path outside of it"),
    "a zip to another drive": (one_zip(zipped(("C:/scan.obj", OBJ))), {}, 422, "a path outside of it"),
    "a zip with backslashes": (one_zip(renamed("a_scan.obj", b"a\\scan.obj")), {}, 422, "a path outside of it"),
    "a zip with a null byte": (one_zip(renamed("scan.obj_.txt", b"scan.obj\0.txt")), {}, 422, "a path outside of it"),
    "a zip with a link": (one_zip(zipped((special(0o120000), b"/etc/passwd"))), {}, 422, "a link or device"),
    "a zip with a pipe": (one_zip(zipped((special(0o010000), b""))), {}, 422, "a link or device"),
    "a zip with a password": (one_zip(locked()), {}, 422, "encrypted"),
    "a zip that lies": (one_zip(lying_about_its_size()), {}, 422, "damaged"),
    "a zip with a name twice": (one_zip(zipped(("a/scan.obj", OBJ), ("b/scan.obj", OBJ))), {}, 422, "two files"),
    "a zip of many files": (one_zip(zipped(*((f"{k}.png", b"") for k in range(25)))), {}, 413, "contains 25 files"),
    "a zip of very many": (one_zip(zipped(*((f"{k}.png", b"") for k in range(3000)))), {}, 413, "more than 20 files"),
    "a bomb": (one_zip(zipped(("scan.obj", b"\0" * 1_900_000))), {}, 413, "which no scan has"),
    "a large bomb": (one_zip(zipped(("scan.obj", b"v 0 0 0\n" * 1_000_000))), {}, 413, "the limit is 2"),
    "a huge image in a zip": (one_zip(zipped(("a.png", png(60_000, 60_000)))), {}, 413, "3600 megapixels"),
}  # fmt: skip
