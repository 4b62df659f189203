"""Formats that people have besides OBJ, PLY and glTF: each gives the sheet that was written."""

import io
import zipfile
from contextlib import suppress

import numpy as np
import pytest
import trimesh

from planish.errors import InputError
from planish.io import read_scan
from planish.io.encode import png_bytes
from samples import picture, sheet_scan

SCAN = sheet_scan(7, 5)
POINTS, FACES = SCAN.mesh.points, SCAN.mesh.faces
PHOTO = picture(40, 60)
UV = np.c_[(SCAN.photo_xy[:, 0] + 0.5) / 60, 1 - (SCAN.photo_xy[:, 1] + 0.5) / 40]
TREE = trimesh.Trimesh(POINTS, FACES, process=False)


def triangles(found):
    return found.scan.mesh.points[found.scan.mesh.faces]


def rows(values):
    return "\n".join(" ".join(f"{x:.6f}" for x in row) for row in values)


def check(path, units="auto", atol=1e-4, photo=False):
    """float32 of 280 mm has steps of 3e-5 mm."""
    found = read_scan(path, units=units)
    np.testing.assert_allclose(triangles(found), POINTS[FACES], atol=atol)
    if photo:
        np.testing.assert_array_equal(found.scan.photo, PHOTO)
        places = found.scan.photo_xy
        corners = places if places.ndim == 3 else places[found.scan.mesh.faces]
        np.testing.assert_allclose(corners, SCAN.photo_xy[FACES], atol=1e-3)
    return found


@pytest.mark.parametrize("kind", ["stl", "stl_ascii", "off"])
def test_points_and_faces_alone(tmp_path, kind):
    data = TREE.export(file_type=kind)
    (tmp_path / f"sheet.{kind[:3]}").write_bytes(data if isinstance(data, bytes) else data.encode())
    found = check(tmp_path / f"sheet.{kind[:3]}")
    assert len(found.scan.mesh.points) == len(POINTS)
    assert not found.scan.has_picture


@pytest.mark.parametrize("cut", [0.3, 0.6, 0.95])
@pytest.mark.parametrize("kind", ["stl_ascii", "off"])
def test_a_cut_text_is_noticed(tmp_path, kind, cut):
    data = TREE.export(file_type=kind)
    data = data if isinstance(data, bytes) else data.encode()
    (tmp_path / f"sheet.{kind[:3]}").write_bytes(data[: int(cut * len(data))])
    with pytest.raises(InputError, match=r"sheet\.(stl|off)"):
        read_scan(tmp_path / f"sheet.{kind[:3]}")


def test_quads_and_colours_of_off(tmp_path):
    text = "COFF\n# units: cm\n4 1 0\n0 0 0 255 0 0\n20 0 0 0 255 0\n20 28 0 0 0 255\n0 28 0 9 9 9\n4 0 1 2 3\n"
    (tmp_path / "sheet.off").write_text(text)
    found = read_scan(tmp_path / "sheet.off")
    assert found.unit == "cm"
    assert found.polygons.sizes.tolist() == [4]
    assert found.scan.colours.tolist() == [[255, 0, 0], [0, 255, 0], [0, 0, 255], [9, 9, 9]]


def test_3mf_with_a_unit_a_place_and_a_texture(tmp_path):
    vertices = "".join(f'<vertex x="{x:.7f}" y="{y:.7f}" z="{z:.7f}"/>' for x, y, z in (POINTS - [10, 0, 0]) / 25.4)
    faces = "".join(f'<triangle v1="{a}" v2="{b}" v3="{c}" pid="2" p1="{a}" p2="{b}" p3="{c}"/>' for a, b, c in FACES)
    places = "".join(f'<tex2coord u="{u:.8f}" v="{v:.8f}"/>' for u, v in UV)
    model = (
        '<?xml version="1.0"?><model unit="inch" xmlns="http://schemas.microsoft.com/3dmanufacturing/core/2015/02" '
        'xmlns:m="http://schemas.microsoft.com/3dmanufacturing/material/2015/02"><resources>'
        '<m:texture2d id="1" path="/3D/Textures/photo.png" contenttype="image/png"/>'
        f'<m:texture2dgroup id="2" texid="1">{places.replace("<tex", "<m:tex")}</m:texture2dgroup>'
        f'<object id="3" type="model"><mesh><vertices>{vertices}</vertices><triangles>{faces}</triangles></mesh>'
        "</object>"
        f'</resources><build><item objectid="3" transform="1 0 0 0 1 0 0 0 1 {10 / 25.4} 0 0"/></build></model>'
    )
    with zipfile.ZipFile(tmp_path / "sheet.3mf", "w", zipfile.ZIP_DEFLATED) as file:
        file.writestr("3D/3dmodel.model", model)
        file.writestr("3D/Textures/photo.png", png_bytes(PHOTO))
    assert check(tmp_path / "sheet.3mf", photo=True).unit == "in"


def test_3mf_of_another_program(tmp_path):
    (tmp_path / "sheet.3mf").write_bytes(TREE.export(file_type="3mf"))
    check(tmp_path / "sheet.3mf", units="mm")


def test_collada_of_another_program(tmp_path):
    (tmp_path / "sheet.dae").write_bytes(TREE.export(file_type="dae"))
    check(tmp_path / "sheet.dae", units="mm")


def test_collada_with_a_unit_a_place_and_a_texture(tmp_path):
    (tmp_path / "photo 1.png").write_bytes(png_bytes(PHOTO))
    index = " ".join(f"{i} {i}" for i in FACES.ravel())
    (tmp_path / "sheet.dae").write_text(
        f"""<?xml version="1.0"?><COLLADA xmlns="http://www.collada.org/2005/11/COLLADASchema" version="1.4.1">
<asset><unit name="centimeter" meter="0.01"/><up_axis>Y_UP</up_axis></asset>
<library_images><image id="img"><init_from>./photo%201.png</init_from></image></library_images>
<library_effects><effect id="fx"><profile_COMMON><newparam sid="surf"><surface type="2D"><init_from>img</init_from>
</surface></newparam><newparam sid="samp"><sampler2D><source>surf</source></sampler2D></newparam><technique><lambert>
<diffuse><texture texture="samp" texcoord="uv"/></diffuse></lambert></technique></profile_COMMON></effect>
</library_effects><library_materials><material id="mat"><instance_effect url="#fx"/></material></library_materials>
<library_geometries><geometry id="g"><mesh><source id="p"><float_array id="pa">{rows(POINTS / 20)}</float_array>
<technique_common><accessor source="#pa" count="{len(POINTS)}" stride="3"/></technique_common></source>
<source id="t"><float_array>{rows(UV)}</float_array></source>
<vertices id="v"><input semantic="POSITION" source="#p"/></vertices>
<triangles material="m" count="{len(FACES)}"><input semantic="VERTEX" source="#v" offset="0"/>
<input semantic="TEXCOORD" source="#t" offset="1" set="0"/><p>{index}</p></triangles></mesh></geometry>
</library_geometries><library_visual_scenes><visual_scene id="s"><node><scale>2 2 2</scale><node>
<instance_geometry url="#g"><bind_material><technique_common><instance_material symbol="m" target="#mat"/>
</technique_common></bind_material></instance_geometry></node></node></visual_scene></library_visual_scenes>
<scene><instance_visual_scene url="#s"/></scene></COLLADA>"""
    )
    found = check(tmp_path / "sheet.dae", atol=2e-5, photo=True)  # six digits of cm, doubled
    assert found.unit == "cm"


VRML = """#VRML V2.0 utf8
# a comment with a {{ bracket
WorldInfo {{ title "Vivid {{ 910" }}
DEF Sheet Transform {{ scale 0.001 0.001 0.001 children [ Shape {{
 appearance Appearance {{ material Material {{ diffuseColor 1 1 1 }} texture ImageTexture {{ url "photo.png" }} }}
 geometry IndexedFaceSet {{ solid FALSE creaseAngle 0.5
  coord Coordinate {{ point [ {points} ] }}
  coordIndex [ {index} ]
  texCoord TextureCoordinate {{ point [ {uv} ] }}
 }} }} ] }}
"""


def test_vrml_97(tmp_path):
    (tmp_path / "photo.png").write_bytes(png_bytes(PHOTO))
    points = ", ".join(" ".join(f"{x:.6f}" for x in row) for row in POINTS)
    index = ", ".join(f"{a}, {b}, {c}, -1" for a, b, c in FACES)
    text = VRML.format(points=points, index=index, uv=rows(UV))
    (tmp_path / "sheet.wrl").write_text(text)
    check(tmp_path / "sheet.wrl", atol=1e-5, photo=True)
    (tmp_path / "cut.wrl").write_text(text[:-200])
    with pytest.raises(InputError, match=r"cut\.wrl"):
        read_scan(tmp_path / "cut.wrl")


def test_x3d(tmp_path):
    (tmp_path / "photo.png").write_bytes(png_bytes(PHOTO))
    index = " ".join(f"{a} {b} {c} -1" for a, b, c in FACES)
    (tmp_path / "sheet.x3d").write_text(
        f"""<?xml version="1.0" encoding="UTF-8"?><X3D version="3.3"><Scene><Transform scale="0.001 0.001 0.001">
<Shape><Appearance><ImageTexture url='"photo.png"'/></Appearance><IndexedFaceSet coordIndex="{index}">
<Coordinate point="{rows(POINTS)}"/><TextureCoordinate point="{rows(UV)}"/></IndexedFaceSet></Shape></Transform>
</Scene></X3D>"""
    )
    check(tmp_path / "sheet.x3d", atol=1e-5, photo=True)


def test_usdz_as_phones_write_it(tmp_path):
    pytest.importorskip("pxr")
    from pxr import Gf, Sdf, Usd, UsdGeom, UsdShade, UsdUtils

    (tmp_path / "photo.png").write_bytes(png_bytes(PHOTO))
    stage = Usd.Stage.CreateNew(str(tmp_path / "sheet.usdc"))
    UsdGeom.SetStageMetersPerUnit(stage, 0.01)
    UsdGeom.Xform.Define(stage, "/root").AddScaleOp().Set(Gf.Vec3f(0.1))
    mesh = UsdGeom.Mesh.Define(stage, "/root/mesh")
    mesh.CreatePointsAttr(POINTS.astype(np.float32))
    mesh.CreateFaceVertexCountsAttr([3] * len(FACES))
    mesh.CreateFaceVertexIndicesAttr(FACES.ravel().tolist())
    primvar = UsdGeom.PrimvarsAPI(mesh).CreatePrimvar("st", Sdf.ValueTypeNames.TexCoord2fArray, "faceVarying")
    primvar.Set(UV[FACES].reshape(-1, 2).astype(np.float32))
    material = UsdShade.Material.Define(stage, "/root/mat")
    shader = UsdShade.Shader.Define(stage, "/root/mat/surface")
    shader.CreateIdAttr("UsdPreviewSurface")
    texture = UsdShade.Shader.Define(stage, "/root/mat/texture")
    texture.CreateIdAttr("UsdUVTexture")
    texture.CreateInput("file", Sdf.ValueTypeNames.Asset).Set("photo.png")
    shader.CreateInput("diffuseColor", Sdf.ValueTypeNames.Color3f).ConnectToSource(
        texture.CreateOutput("rgb", Sdf.ValueTypeNames.Float3)
    )
    material.CreateSurfaceOutput().ConnectToSource(shader.ConnectableAPI(), "surface")
    UsdShade.MaterialBindingAPI.Apply(mesh.GetPrim()).Bind(material)
    stage.Save()
    UsdUtils.CreateNewUsdzPackage(Sdf.AssetPath(str(tmp_path / "sheet.usdc")), str(tmp_path / "sheet.usdz"))
    assert check(tmp_path / "sheet.usdz", photo=True).unit == "cm"
    check(tmp_path / "sheet.usdc", photo=True)
    data = (tmp_path / "sheet.usdz").read_bytes()
    (tmp_path / "cut.usdz").write_bytes(data[: len(data) // 2])
    with pytest.raises(InputError, match=r"cut\.usdz"):
        read_scan(tmp_path / "cut.usdz")


def test_a_bomb_in_a_zip_is_refused(tmp_path):
    file = io.BytesIO()
    with zipfile.ZipFile(file, "w", zipfile.ZIP_DEFLATED) as packed:
        packed.writestr("3D/3dmodel.model", b"<model>" + b" " * 20_000_000)
    data = file.getvalue().replace((20_000_007).to_bytes(4, "little"), (2_000_000_007).to_bytes(4, "little"))
    (tmp_path / "bomb.3mf").write_bytes(data)
    with pytest.raises(InputError, match=r"bomb\.3mf"):
        read_scan(tmp_path / "bomb.3mf")


@pytest.mark.parametrize("data", [b'#usda 1.0\n\xe0(\n"', b'#usda 1.0\ndef Mesh "a\xe0b" { \xff }\n'])
def test_a_usd_whose_damage_is_no_text_is_refused_in_one_sentence(tmp_path, data):
    pytest.importorskip("pxr")
    (tmp_path / "sheet.usda").write_bytes(data)
    with pytest.raises(InputError, match=r"damaged or cut short$"):
        read_scan(tmp_path / "sheet.usda")


def test_a_usd_that_turns_its_points_by_no_number_is_read_without_a_word(tmp_path, capfd, monkeypatch):
    pytest.importorskip("pxr")
    monkeypatch.setenv("PLANISH_OWN_PROCESS", "1")
    (tmp_path / "sheet.usda").write_text(
        """#usda 1.0
def Mesh "mesh" {
    int[] faceVertexCounts = [3]
    int[] faceVertexIndices = [0, 1, 2]
    point3f[] points = [(0, 0, 0), (20, 0, 0), (0, 28, 1e999)]
    matrix4d xformOp:transform = ((1, 0, 0, 0), (0, 1, 0, 0), (0, 0, 1, 0), (0, 0, 0, 1))
    uniform token[] xformOpOrder = ["xformOp:transform"]
}
"""
    )
    with suppress(InputError):
        read_scan(tmp_path / "sheet.usda", units="mm")
    assert capfd.readouterr().err == ""
