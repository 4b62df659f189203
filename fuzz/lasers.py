"""Planes of lasers, as JSON and CSV, and rigs of lasers and camera."""

import json

from harness import SHELF, fuzz, instrumented

lasers = instrumented("planish.io.lasers")
instrumented("planish.io.cameras")

from planish.io.cameras import camera_as_json
from samples import camera_above

NAMES = ["1.jpg", "2.jpg"]
planes = [[0, 0, 2, -8], [0, 1, 1, -3]]
forms = [
    {"planes": planes, "photos": NAMES[::-1], "note": "a"},
    {"lasers": planes[:1], "axis": {"point": [0, 0, 1], "direction": [1, 0, 0]}, "angles_deg": [10, 20]},
    {"lasers": planes[:1], "direction": [0, 0, 1], "positions_mm": [1, 2]},
    {"background": [{"plane": plane, "region": [0, 0, 9, 9]} for plane in planes]},
]
rig = {"lasers": planes, "camera": camera_as_json(camera_above())}
seeds = [b"\0" + json.dumps(form).encode() for form in forms]
seeds += [b"\1photo,a,b,c,d\n2.jpg,0,0,2,-8\n1.jpg,0,0,1,-3\n", b"\2" + json.dumps(rig).encode()]
words = [f'"{key}":'.encode() for form in forms for key in form]
words += b"null true NaN Infinity 1e999 -0 {} [] [[]] 1e-320 , a,b,c,d ,,, nan 99999999999".split()


def read(data: bytes) -> None:
    kind, path = data[:1], SHELF / ("sweep.csv" if data[:1] == b"\1" else "sweep.json")
    path.write_bytes(data[1:])
    if kind == b"\2":
        lasers.read_rig(path)
    else:
        lasers.read_sweep(path, NAMES)


fuzz(read, seeds, words)
