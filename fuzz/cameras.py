"""Camera files in all their forms."""

import json

from harness import SHELF, fuzz, instrumented

cameras = instrumented("planish.io.cameras")

from planish.io.cameras import camera_as_json
from samples import camera_above

own = camera_as_json(camera_above())
forms = [
    own,
    {"fx": 900, "fy": 900, "cx": 319.5, "cy": 239.5, "image_size": [640, 480], "rotation": [0.1, 0, 0], "note": "a"},
    {"P": {"a.jpg": [[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 1]]}, "image_size": [640, 480]},
    {"focal_px": 900, "width": 640, "height": 480, "cam": [0, 0, 400]},
    {"cameras": {"a.jpg": own}},
]
words = [f'"{key}":'.encode() for form in forms for key in form]
words += b'"distortion":[0,0,0,0] null true NaN Infinity -Infinity 1e999 -0 {} [] "" [[]] 1e-320 "a.jpg"'.split()


def read(data: bytes) -> None:
    path = SHELF / "camera.json"
    path.write_bytes(data)
    cameras.read_camera(path, "a.jpg", mm_per_unit=1000.0)
    cameras.holds_many(path)


fuzz(read, [json.dumps(form).encode() for form in forms], words)
