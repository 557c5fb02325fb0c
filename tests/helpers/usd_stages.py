"""Small scenes as USD stages, and what reading or validating them gives."""

from pathlib import Path

import numpy as np
import pytest
import trimesh
from pxr import Gf, Sdf, Usd, UsdGeom, UsdPhysics, UsdShade, UsdValidation, Vt

from warpdem import Scene, SceneError, load_scene

MESH = np.array(trimesh.creation.icosphere(subdivisions=1, radius=0.1).triangles, np.float32)
"""Triangles of a ball [m], z upwards; none of its coordinates is special."""


def new_stage(path, metres=1.0, up="Z"):
    """A stage with a scene prim and one material, in the given units."""
    stage = Usd.Stage.CreateNew(str(path))
    UsdGeom.SetStageMetersPerUnit(stage, metres)
    UsdGeom.SetStageUpAxis(stage, up)
    physics = UsdPhysics.Scene.Define(stage, "/Physics")
    physics.CreateGravityDirectionAttr(Gf.Vec3f(0, 0, -1) if up == "Z" else Gf.Vec3f(0, -1, 0))
    physics.CreateGravityMagnitudeAttr(9.81 / metres)
    author(physics.GetPrim(), "time:end", Sdf.ValueTypeNames.Double, 1.0)
    author(physics.GetPrim(), "time:step", Sdf.ValueTypeNames.Double, 2e-5)
    author(physics.GetPrim(), "time:max_speed", Sdf.ValueTypeNames.String, "2 m/s")
    author(physics.GetPrim(), "engine:max_overlap", Sdf.ValueTypeNames.Double, 0.5)
    material = UsdShade.Material.Define(stage, "/Looks/g").GetPrim()
    api = UsdPhysics.MaterialAPI.Apply(material)
    api.CreateDensityAttr(2500.0 * metres**3)
    api.CreateDynamicFrictionAttr(0.5)
    api.CreateRestitutionAttr(0.5)
    author(material, "young_modulus", Sdf.ValueTypeNames.Double, 5e6)
    author(material, "poisson_ratio", Sdf.ValueTypeNames.Double, 0.3)
    return stage


def author(prim, key, kind, value):
    prim.CreateAttribute(f"dem:{key}", kind).Set(value)


def collide(prim):
    UsdPhysics.CollisionAPI.Apply(prim.GetPrim())
    material = UsdShade.Material.Get(prim.GetPrim().GetStage(), "/Looks/g")
    UsdShade.MaterialBindingAPI.Apply(prim.GetPrim()).Bind(material, materialPurpose="physics")
    return prim


def define_loose_mesh(stage, path, corners):
    """A mesh of loose triangles (t, 3, 3)."""
    mesh = UsdGeom.Mesh.Define(stage, path)
    mesh.CreatePointsAttr(Vt.Vec3fArray.FromNumpy(np.ascontiguousarray(corners.reshape(-1, 3), np.float32)))
    mesh.CreateFaceVertexCountsAttr([3] * len(corners))
    mesh.CreateFaceVertexIndicesAttr(list(range(3 * len(corners))))
    return mesh


def define_mesh(stage, path, corners):
    """A collider of loose triangles (t, 3, 3)."""
    return collide(define_loose_mesh(stage, path, corners))


def define_grains(stage, path="/Grains", points=((0.01, 0.0, 0.3),), width=0.01):
    grains = UsdGeom.Points.Define(stage, path)
    grains.CreatePointsAttr(Vt.Vec3fArray([Gf.Vec3f(*map(float, p)) for p in points]))
    grains.CreateWidthsAttr([width] * len(points))
    return collide(grains)


def read(stage, **options) -> Scene:
    stage.Save()
    return load_scene(stage.GetRootLayer().realPath, **options)


def refusal(stage, **options) -> str:
    with pytest.raises(SceneError) as caught:
        read(stage, **options)
    return str(caught.value)


def validation_errors(path: Path) -> list[str]:
    """What all validators that come with USD find wrong with a stage."""
    validators = UsdValidation.ValidationRegistry().GetOrLoadAllValidators()
    assert len(validators) > 20
    return [
        error.GetErrorAsString()
        for error in UsdValidation.ValidationContext(validators).Validate(Usd.Stage.Open(str(path)))
    ]
