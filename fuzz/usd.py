"""USD as text, as binary crates and in a USDZ."""

from harness import SHELF, fuzz, instrumented

meshes = instrumented("planish.io.meshes")
for module in ("usd", "zipped", "scene"):
    instrumented(f"planish.io.{module}")

import numpy as np
from pxr import Sdf, Usd, UsdGeom, UsdUtils

stage = Usd.Stage.CreateNew(str(SHELF / "seed.usdc"))
UsdGeom.SetStageMetersPerUnit(stage, 0.01)
mesh = UsdGeom.Mesh.Define(stage, "/root/mesh")
mesh.CreatePointsAttr(np.array([[0, 0, 0], [20, 0, 0], [20, 28, 0], [0, 28, 0]], np.float32))
mesh.CreateFaceVertexCountsAttr([4])
mesh.CreateFaceVertexIndicesAttr([0, 1, 2, 3])
places = UsdGeom.PrimvarsAPI(mesh).CreatePrimvar("st", Sdf.ValueTypeNames.TexCoord2fArray, "vertex")
places.Set(np.array([[0, 0], [1, 0], [1, 1], [0, 1]], np.float32))
stage.Save()
UsdUtils.CreateNewUsdzPackage(Sdf.AssetPath(str(SHELF / "seed.usdc")), str(SHELF / "seed.usdz"))
TEXT = stage.GetRootLayer().ExportToString().encode()
seeds = [TEXT, (SHELF / "seed.usdc").read_bytes(), (SHELF / "seed.usdz").read_bytes()]
words = b"#usda def Mesh Xform over class point3f[] int[] float2[] matrix4d token asset @a.png@ inputs:file".split()
words += b"metersPerUnit faceVertexCounts faceVertexIndices primvars:st:indices interpolation -1 nan inf 1e38".split()
words += [b"PXR-USDC", b"PK\x03\x04", b"references = @seed.usdc@", b"xformOp:transform", b'"faceVarying"', b"</root>"]


def read(data: bytes) -> None:
    (SHELF / "sheet.usd").write_bytes(data)
    meshes.read_mesh(SHELF / "sheet.usd", inside=SHELF)


fuzz(read, seeds, words)
