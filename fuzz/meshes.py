"""STL, OFF, 3MF, COLLADA, X3D and VRML, told by their content."""

import io
import zipfile

from harness import SHELF, fuzz, instrumented

meshes = instrumented("planish.io.meshes")
for module in ("plain_meshes", "xml_meshes", "vrml", "scene", "zipped"):
    instrumented(f"planish.io.{module}")

import numpy as np

STL = b"h" * 80 + np.array([2], "<u4").tobytes() + np.arange(24, dtype="<f4").tobytes()[:48].ljust(50, b"\0") * 2
TEXT_STL = (
    b"solid a\nfacet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 1 0 0\nvertex 0 "
    b"1e0 0\nendloop\nendfacet\nendsolid a\n"
)
OFF = b"COFF\n# units: mm\n4 1 0\n0 0 0 255 0 0\n20 0 0 0 255 0\n20 28 0 0 0 255\n0 28 0 9 9 9\n4 0 1 2 3\n"
MODEL = (
    b'<model unit="inch"><resources><texture2d id="1" path="/a.png"/><texture2dgroup id="2" texid="1"><tex2coord u="0" '
    b'v="0"/></texture2dgroup><object id="3" pid="2" '
    b'pindex="0"><mesh><vertices><vertex x="0" y="0" z="0"/><vertex x="1" '
    b'y="0" z="0"/><vertex x="0" y="1" z="0"/></vertices><triangles><triangle v1="0" v2="1" v3="2" p1="0"/></triangles>'
    b'</mesh></object></resources><build><item objectid="3" transform="1 0 0 0 1 0 0 0 1 0 0 0"/></build></model>'
)
DAE = (
    b'<COLLADA><asset><unit meter="0.01"/></asset><library_geometries><geometry '
    b'id="g"><mesh><source id="p"><float_array>'
    b'0 0 0 1 0 0 0 1 0</float_array></source><vertices id="v"><input semantic="POSITION" source="#p"/></vertices>'
    b'<polylist><input semantic="VERTEX" source="#v" '
    b'offset="0"/><vcount>3</vcount><p>0 1 2</p></polylist></mesh></geometry>'
    b'</library_geometries><library_visual_scenes><visual_scene id="s"><node id="n"><rotate>0 0 1 90</rotate>'
    b"<instance_geometry "
    b'url="#g"/></node></visual_scene></library_visual_scenes><scene><instance_visual_scene url="#s"/>'
    b"</scene></COLLADA>"
)
VRML = (
    b"#VRML V2.0 utf8\nDEF a Transform { scale 1 1 1 rotation 0 0 1 1.5 children [ "
    b"Shape { appearance Appearance { texture "
    b'ImageTexture { url "a.png" } } geometry IndexedFaceSet { ccw FALSE coord '
    b"Coordinate { point [ 0 0 0, 1 0 0, 0 1 0 ] } "
    b"coordIndex [ 0 1 2 -1 ] color Color { color [ 1 0 0 0 1 0 0 0 1 ] } } } USE a ] }\n"
)
X3D = (
    b'<X3D><Scene><Transform DEF="t"><Shape><IndexedTriangleSet index="0 1 2"><Coordinate point="0 0 0 1 0 0 0 1 0"/>'
    b"</IndexedTriangleSet></Shape></Transform></Scene></X3D>"
)
SPLIT = b"3MF:"
"""What follows goes into a 3MF."""

words = (
    b"solid facet vertex endsolid OFF NOFF USE DEF NULL TRUE children Transform { } [ ] -1 1e999 nan <node> </node>"
).split()
words += [
    b'url="#g"',
    b'offset="9"',
    b'objectid="3"',
    b'pid="2"',
    b"<p>",
    b"</p>",
    b"\xff\xfe",
    b"&lt;",
    b"ROUTE",
    b"PROTO",
]


def read(data: bytes) -> None:
    if data.startswith(SPLIT):
        file = io.BytesIO()
        with zipfile.ZipFile(file, "w") as packed:
            packed.writestr("3D/3dmodel.model", data[len(SPLIT) :])
        data = file.getvalue()
    path = SHELF / "sheet.mesh"
    path.write_bytes(data)
    meshes.read_mesh(path, inside=SHELF)


fuzz(read, [STL, TEXT_STL, OFF, SPLIT + MODEL, DAE, VRML, X3D], words)
