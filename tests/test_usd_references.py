"""Stages put together from parts: references within a file, payloads, classes, variants, instances, layers and packages."""

import shutil

import numpy as np
import pytest
from pxr import Gf, Sdf, Usd, UsdGeom, UsdUtils

from usd_stages import author, collide, define_grains, define_mesh, new_stage, read, refusal
from warpdem import SceneError, load_scene
from warpdem.mesh.usd_geometry import read_triangles
from warpdem.usd import motion as usd_motion

TETRAHEDRON = np.array([[[0, 0, 0], [0, 1, 0], [1, 0, 0]], [[0, 0, 0], [1, 0, 0], [0, 0, 1]],
                        [[0, 0, 0], [0, 0, 1], [0, 1, 0]], [[1, 0, 0], [0, 1, 0], [0, 0, 1]]], float) / 8  # fmt: skip
SHIFT = np.array([3.0, 0.0, 0.0])


def reference(prim):
    prim.GetReferences().AddInternalReference("/Parts/Post")


def instance(prim):
    reference(prim)
    prim.SetInstanceable(True)


def payload(prim):
    prim.GetPayloads().AddInternalPayload("/Parts/Post")


def inherit(prim):
    prim.GetInherits().AddInherit("/Parts/Post")


def specialize(prim):
    prim.GetSpecializes().AddSpecialize("/Parts/Post")


def variant(prim):
    sets = prim.GetVariantSets().AddVariantSet("size")
    for name in ("small", "large"):
        sets.AddVariant(name)
    sets.SetVariantSelection("large")
    with sets.GetVariantEditContext():
        reference(prim)


def nested(prim):
    """A reference to a prim that refers to the part itself."""
    prim.GetStage().DefinePrim("/Parts/Copy").GetReferences().AddInternalReference("/Parts/Post")
    prim.GetReferences().AddInternalReference("/Parts/Copy")
    prim.SetInstanceable(True)


def through_a_sublayer(prim):
    """The reference stands in a layer of its own."""
    stage = prim.GetStage()
    layer = Sdf.Layer.CreateNew(stage.GetRootLayer().realPath.replace("a.usda", "sub.usda"))
    Sdf.CreatePrimInLayer(layer, prim.GetPath()).referenceList.prependedItems = [Sdf.Reference(primPath="/Parts/Post")]
    layer.Save()
    stage.GetRootLayer().subLayerPaths.append("./sub.usda")


WAYS = [reference, instance, payload, inherit, specialize, variant, nested, through_a_sublayer]


def stage_of(path, way):
    """A part, and the same shifted and mirrored by another prim."""
    stage = new_stage(path)
    stage.CreateClassPrim("/Parts")
    define_mesh(stage, "/Parts/Post/Skin", TETRAHEDRON)
    copy = UsdGeom.Xform.Define(stage, "/Copy")
    copy.AddTranslateOp().Set(Gf.Vec3d(*SHIFT))
    copy.AddScaleOp().Set(Gf.Vec3f(-2, 2, 2))
    way(copy.GetPrim())
    define_grains(stage)
    stage.Save()
    return stage


@pytest.mark.parametrize("way", WAYS)
def test_parts_of_the_same_file_are_read_where_they_stand(tmp_path, way):
    """In a scene in USD and as the mesh of a wall, with and without bounds to the folders that may be read."""
    stage = stage_of(tmp_path / "a.usda", way)
    (wall,) = read(stage).walls
    assert (wall.mesh, wall.prim, wall.material) == ("a.usda", "/Copy/Skin", "g")
    mirrored = TETRAHEDRON[:, ::-1] * [-2, 2, 2] + SHIFT
    for folders in (None, [tmp_path]):
        for prim in ("/Copy", "/Copy/Skin"):
            corners, _ = read_triangles(tmp_path / "a.usda", prim, "walls[0].mesh", folders)
            np.testing.assert_allclose(corners, mirrored, rtol=0, atol=1e-6)


@pytest.mark.parametrize("way", [instance, payload])
def test_a_package_is_read_like_its_stage(tmp_path, way):
    stage = stage_of(tmp_path / "a.usda", way)
    assert UsdUtils.CreateNewUsdzPackage(stage.GetRootLayer().realPath, str(tmp_path / "a.usdz"))
    (wall,) = load_scene(tmp_path / "a.usdz").walls
    assert (wall.mesh, wall.prim) == ("a.usdz", "/Copy/Skin")
    corners, _ = read_triangles(tmp_path / "a.usdz", "/Copy", "walls[0].mesh", [tmp_path])
    np.testing.assert_array_equal(corners, read_triangles(tmp_path / "a.usda", "/Copy", "walls[0].mesh")[0])


def test_a_reference_within_does_not_hide_one_to_the_outside(tmp_path):
    home, outside = tmp_path / "home", tmp_path / "outside"
    home.mkdir(), outside.mkdir()
    stage_of(outside / "a.usda", reference)
    stage = stage_of(home / "a.usda", reference)
    for name in ("../outside/a.usda", str(outside / "a.usda")):
        far = stage.DefinePrim("/Far")
        far.GetReferences().SetReferences([Sdf.Reference(primPath="/Parts/Post"), Sdf.Reference(name, "/Copy")])
        stage.Save()
        with pytest.raises(SceneError, match="outside the folders that may be read"):
            load_scene(home / "a.usda")
        with pytest.raises(SceneError, match="outside the folders that may be read"):
            read_triangles(home / "a.usda", "/Copy", "walls[0].mesh", [home])
    assert len(load_scene(home / "a.usda", allow_paths=[outside]).walls) == 2


def lose_reference(stage):
    stage.DefinePrim("/Far").GetReferences().AddReference("./none.usda")


def lose_prim(stage):
    stage.DefinePrim("/Far").GetReferences().AddInternalReference("/None")


def lose_payload(stage):
    stage.DefinePrim("/Far").GetPayloads().AddPayload("./none.usda")


def lose_sublayer(stage):
    stage.GetRootLayer().subLayerPaths.append("./none.usda")


def lose_clip(stage):
    clips = Usd.ClipsAPI(stage.DefinePrim("/Far"))
    clips.SetClipAssetPaths([Sdf.AssetPath("./none.usda")])
    clips.SetClipPrimPath("/Far")


def lose_variant(stage):
    sets = stage.DefinePrim("/Far").GetVariantSets().AddVariantSet("size")
    sets.AddVariant("small")
    sets.SetVariantSelection("huge")


@pytest.mark.parametrize(
    ("lose", "words"),
    [
        (lose_reference, "none.usda"),
        (lose_prim, "</None>"),
        (lose_payload, "none.usda"),
        (lose_sublayer, "none.usda"),
        (lose_clip, "a value clip is missing: './none.usda'"),
        (lose_variant, "/Far: variant size = 'huge': no such variant; there is small"),
    ],
)
def test_what_is_missing_is_an_error_and_no_empty_prim(tmp_path, lose, words):
    stage = stage_of(tmp_path / "a.usda", reference)
    lose(stage)
    assert words in refusal(stage)
    with pytest.raises(SceneError, match="a.usda"):
        read_triangles(tmp_path / "a.usda", "/Copy", "walls[0].mesh", [tmp_path])


def test_layers_with_other_time_scales_move_as_they_say(tmp_path):
    """A part that turns by 48 codes a second, in a stage with 24: its two seconds stay two seconds."""
    part = Usd.Stage.CreateNew(str(tmp_path / "part.usda"))
    part.SetTimeCodesPerSecond(48.0)
    shift = UsdGeom.Xform.Define(part, "/Arm").AddTranslateOp()
    shift.Set(Gf.Vec3d(0, 0, 0), 0.0)
    shift.Set(Gf.Vec3d(1, 0, 0), 96.0)
    part.Save()
    stage = new_stage(tmp_path / "a.usda")
    stage.SetTimeCodesPerSecond(24.0)
    stage.DefinePrim("/Arm").GetReferences().AddReference("./part.usda", "/Arm")
    stage.Save()
    motion = usd_motion.read(tmp_path / "a.usda", "/Arm", "frame")
    np.testing.assert_array_equal(motion.time.astype(float), [0.0, 2.0])


def test_colliders_that_are_hidden_or_guides_are_walls(tmp_path):
    """Programs hide the simpler shapes that collide; for physics they are there."""
    stage = new_stage(tmp_path / "a.usda")
    define_grains(stage)
    collide(UsdGeom.Cube.Define(stage, "/Hidden")).MakeInvisible()
    collide(UsdGeom.Cube.Define(stage, "/Guide")).CreatePurposeAttr("guide")
    scene = read(stage)
    assert [wall.name for wall in scene.walls] == ["Hidden", "Guide"]
    assert scene.notes == ()
    for wall in scene.walls:
        assert len(read_triangles(tmp_path / "a.usda", wall.prim, "walls[0].mesh")[0]) == 12


def test_visibility_that_changes_is_told_of_a_mesh(tmp_path):
    stage = stage_of(tmp_path / "a.usda", reference)
    shown = UsdGeom.Imageable(stage.OverridePrim("/Copy/Skin")).CreateVisibilityAttr()
    shown.Set("inherited", 0.0)
    shown.Set("invisible", 24.0)
    stage.Save()
    corners, notes = read_triangles(tmp_path / "a.usda", "/Copy", "walls[0].mesh")
    assert len(corners) == 4
    assert "/Copy/Skin: its visibility changes with time; its state at time 0 is used" in notes


def test_primvars_with_indices_are_spread_out(tmp_path):
    stage = new_stage(tmp_path / "a.usda")
    grains = define_grains(stage, points=[(0, 0, 0), (0, 0, 1), (0, 0, 2)])
    widths = UsdGeom.PrimvarsAPI(grains).CreatePrimvar("widths", Sdf.ValueTypeNames.FloatArray, "vertex")
    widths.Set([0.1, 0.2])
    widths.SetIndices([1, 0, 1])
    np.testing.assert_array_equal(read(stage).grains[0].diameters, [0.2, 0.1, 0.2])


def test_files_named_by_a_referenced_part_are_found_beside_it(tmp_path):
    (tmp_path / "parts").mkdir()
    part = Usd.Stage.CreateNew(str(tmp_path / "parts" / "part.usda"))
    wall = part.DefinePrim("/Wall")
    author(wall, "list", Sdf.ValueTypeNames.String, "walls")
    author(wall, "name", Sdf.ValueTypeNames.String, "box")
    author(wall, "material", Sdf.ValueTypeNames.String, "g")
    author(wall, "mesh", Sdf.ValueTypeNames.Asset, Sdf.AssetPath("./box.usda"))
    part.Save()
    box = new_stage(tmp_path / "parts" / "box.usda")
    define_mesh(box, "/Box", TETRAHEDRON)
    box.Save()
    stage = new_stage(tmp_path / "a.usda")
    define_grains(stage)
    stage.DefinePrim("/Wall").GetReferences().AddReference("./parts/part.usda", "/Wall")
    assert read(stage).walls[0].mesh == "parts/box.usda"
    shutil.rmtree(tmp_path / "parts")
    with pytest.raises(SceneError, match="part.usda"):
        load_scene(tmp_path / "a.usda")
