"""Cameras of other programs: JSON, YAML, XML and COLMAP's text."""

import json

from harness import SHELF, fuzz, instrumented

cameras = instrumented("planish.io.cameras")
instrumented("planish.io.foreign_cameras")

MATRIX = [900, 0, 319.5, 0, 900, 239.5, 0, 0, 1]
forms = [
    {"intrinsic_matrix": [900, 0, 0, 0, 900, 0, 319.5, 239.5, 1], "width": 640, "height": 480, "serial": 1},
    {
        "intrinsic": {"K": MATRIX, "width": 640, "height": 480},
        "extrinsic": [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1],
    },
    {"K": MATRIX, "D": [0, 0, 0, 0, 0], "distortion_model": "plumb_bob", "width": 640, "height": 480, "P": []},
    {"fx": 900, "fy": 900, "ppx": 1, "ppy": 2, "coeffs": [0, 0], "width": 640, "height": 480},
    {"camera_matrix": {"data": MATRIX}, "image_width": 640, "image_height": 480},
    {
        "fx": 9,
        "fy": 9,
        "cx": 1,
        "cy": 2,
        "width": 64,
        "height": 48,
        **{f"t_{r}{c}": int(r == c) for r in range(3) for c in range(4)},
    },
]
yaml = (
    b"%YAML:1.0\nimage_width: 640\nimage_height: 480\ncamera_matrix:\n  rows: 3\n  "
    b"data: [900, 0, 1, 0, 900, 2, 0, 0, 1]\nD:\n- 0.1\n- 0.2\n"
)
xml = (
    b"<opencv_storage><image_width>640</image_width><image_height>480</image_height>"
    b"<K><data>9 0 1 0 9 2 0 0 1</data></K></opencv_storage>"
)
metashape = (
    b'<document><chunk><sensors><sensor id="0"><calibration '
    b'class="adjusted"><resolution width="640" height="480"/><f>9</f>'
    b'</calibration></sensor></sensors><cameras><camera sensor_id="0" '
    b'label="a"><transform>1 0 0 0 0 1 0 0 0 0 1 0 0 0 0 1'
    b"</transform></camera></cameras><transform><scale>2</scale></transform></chunk></document>"
)
colmap = b"1 OPENCV 640 480 900 900 320 240 0 0 0 0\n"
words = (
    b"K: D: data: [ ] - nan 1e999 SIMPLE_RADIAL FULL_OPENCV <data> </data> <f> <transform> label= image_width".split()
)


def read(data: bytes) -> None:
    path = SHELF / "cameras.txt"
    path.write_bytes(data)
    cameras.read_camera(path, "a.jpg", photo_shape=(480, 640), warnings=[])


fuzz(read, [*(json.dumps(form).encode() for form in forms), yaml, xml, metashape, colmap], words)
