"""A scene as a USD stage in metres, z upwards, as `warpdem.usd.scene` reads it."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from pxr import Gf, Sdf, Tf, Usd, UsdGeom, UsdPhysics, UsdShade, Vt

from warpdem.core.atomic_file import not_written, replaced
from warpdem.errors import SceneError
from warpdem.scene.tables import names_file
from warpdem.scene.write_usd_free import author_free

WORLD, SCENE, MATERIALS, GRAINS, WALLS = "/World", "/World/Scene", "/World/Materials", "/World/Grains", "/World/Frame/Walls"
GRAIN_KEYS = ("positions", "velocities", "spins", "radii", "diameters")
"""Arrays of a group of grains that are written as float64 primvars."""
_NUMBERS = Sdf.ValueTypeNames


def write_usd_scene(path: Path, tables: dict[str, Any], *, bodies: bool = True) -> None:
    """Write the stage of a scene.

    Args:
        path: File ending in .usda, .usdc or .usd.
        tables: The scene's tables from `warpdem.scene.tables`, with files relative to the folder of ``path``.
        bodies: Whether free walls are rigid bodies for other programs too; in the result of a run they move by time samples.

    Raises:
        OutputError: The file cannot be written.
        SceneError: A table has a name that USD does not allow.
    """
    layer = Sdf.Layer.CreateAnonymous(path.suffix)
    _Writer(Usd.Stage.Open(layer), tables, bodies)
    export(layer, path)


def set_units(layer: Sdf.Layer) -> None:
    """Set the units of a layer to metres and kilograms with z upwards, and its default prim to /World."""
    layer.defaultPrim = WORLD.removeprefix("/")
    for key, value in ((UsdGeom.Tokens.metersPerUnit, 1.0), (UsdGeom.Tokens.upAxis, UsdGeom.Tokens.z),
                       (UsdPhysics.Tokens.kilogramsPerUnit, 1.0)):  # fmt: skip
        layer.pseudoRoot.SetInfo(key, value)


def export(layer: Sdf.Layer, path: Path) -> None:
    """Write a layer completely or not at all.

    Raises:
        OutputError: It cannot be written.
    """
    with replaced(path) as part:
        try:
            written = layer.Export(str(part))
        except Tf.ErrorException:  # on a full disk, where it might return false
            written = False
        if not written:
            raise not_written(path)


def unused_paths(parent: str, names: list[str], taken: Sequence[str] = ()) -> list[str]:
    """Distinct paths below ``parent``, none of those ``taken``; names that USD does not allow are changed."""
    paths: list[str] = []
    for name in names:
        path = stem = f"{parent}/{Tf.MakeValidIdentifier(name)}"
        count = 1
        while path in paths or path in taken:
            count += 1
            path = f"{stem}_{count}"
        paths.append(path)
    return paths


class _Writer:
    """Authors a stage table by table."""

    def __init__(self, stage: Usd.Stage, tables: dict[str, Any], bodies: bool) -> None:
        self.stage, self.tables, self.bodies = stage, tables, bodies
        set_units(stage.GetRootLayer())
        for path in (WORLD, WALLS.rsplit("/", 1)[0]):
            UsdGeom.Xform.Define(stage, path)
        for path in (MATERIALS, GRAINS, WALLS):
            UsdGeom.Scope.Define(stage, path)
        names = list(tables["materials"])
        self.materials = dict(zip(names, unused_paths(MATERIALS, names), strict=True))
        for name, path in self.materials.items():
            self.material(name, path)
        self.scene()
        self.groups(tables.get("grains", []))
        walls = tables.get("walls", [])
        self.entries(walls, "walls", unused_paths(WALLS, [wall["name"] for wall in walls]))

    # -- any table -----------------------------------------------------------------------

    def table(self, prim: Usd.Prim, table: dict[str, Any], prefix: str = "dem") -> None:
        """Author the keys of a table as attributes, nested tables with longer names, lists of tables as child prims."""
        for key, value in table.items():
            name = f"{prefix}:{key}"
            if not Sdf.Path.IsValidNamespacedIdentifier(name):
                key_name = f"{prim.GetName()}: {name.removeprefix('dem:').replace(':', '.')}"
                raise SceneError(
                    f"{key_name}: USD allows letters, digits and _ in names: rename {key!r}, or write the scene as TOML"
                )
            if isinstance(value, dict):
                self.table(prim, value, name)
            elif isinstance(value, list) and value and isinstance(value[0], dict):
                listed = name.removeprefix("dem:")
                wanted = [str(entry.get("name", f"{key}_{i}")) for i, entry in enumerate(value)]
                taken = [str(child.GetPath()) for child in prim.GetChildren()]  # of other lists of the same table
                self.entries(value, listed, unused_paths(str(prim.GetPath()), wanted, taken))
            elif key == "material" and value in self.materials and prefix == "dem":
                self.bind(prim, value)
            elif key == "material" and value in self.materials:  # of a nested table: not what the prim is made of
                prim.CreateRelationship(name).SetTargets([self.materials[value]])
            elif key == "materials" and set(value) <= self.materials.keys():
                prim.CreateRelationship(name).SetTargets([self.materials[material] for material in value])
            else:
                self.attribute(prim, name, value, names_file(key, value))

    def entries(self, entries: list[dict[str, Any]], listed: str, paths: list[str]) -> None:
        """A prim for each entry of a list of tables."""
        for entry, path in zip(entries, paths, strict=True):
            prim = self.stage.DefinePrim(path)
            self.attribute(prim, "dem:list", listed)
            self.table(prim, entry)
            if listed == "walls":
                _author_surface_velocity(prim, entry.get("surface_velocity"))
                if self.bodies and entry.get("free"):
                    author_free(self.stage, path, entry["free"])

    def attribute(self, prim: Usd.Prim, name: str, value: Any, is_file: bool = False) -> None:
        """Author one attribute, with the type of its value."""
        value_type, converted = _typed(value)
        if is_file:
            value_type, converted = _NUMBERS.Asset, Sdf.AssetPath(value)
        prim.CreateAttribute(name, value_type, True, Sdf.VariabilityUniform).Set(converted)

    def bind(self, prim: Usd.Prim, material: str) -> None:
        """Bind a material for physics."""
        target = UsdShade.Material.Get(self.stage, self.materials[material])
        UsdShade.MaterialBindingAPI.Apply(prim).Bind(target, materialPurpose="physics")

    # -- prims of UsdPhysics --------------------------------------------------------------------

    def material(self, name: str, path: str) -> None:
        """A material; the coefficients of its pair with itself are written for other programs too."""
        table = dict(self.tables["materials"][name])
        prim = UsdShade.Material.Define(self.stage, path).GetPrim()
        physics = UsdPhysics.MaterialAPI.Apply(prim)
        physics.CreateDensityAttr(table["density"])
        if _is_exact_in_single(table["density"]):
            table.pop("density")
        if prim.GetName() != name:
            self.attribute(prim, "dem:name", name)
        for pair in self.tables.get("pairs", []):
            if pair["materials"] == [name, name] and pair.get("contact", True):
                physics.CreateRestitutionAttr(pair["restitution"])
                physics.CreateDynamicFrictionAttr(pair.get("friction", 0.0))
        self.table(prim, table)

    def scene(self) -> None:
        """Gravity, and the tables that have no prims of their own."""
        tables = {key: value for key, value in self.tables.items() if key not in ("materials", "walls", "grains")}
        physics = UsdPhysics.Scene.Define(self.stage, SCENE)
        gravity = np.array(tables.pop("gravity", (0.0, 0.0, -9.81)))
        strength = float(np.linalg.norm(gravity))
        direction = gravity / strength if strength else np.array([0.0, 0.0, -1.0])
        physics.CreateGravityDirectionAttr(Gf.Vec3f(*direction.tolist()))
        physics.CreateGravityMagnitudeAttr(strength)
        if np.count_nonzero(gravity) > 1 or not _is_exact_in_single(strength):
            tables["gravity"] = gravity.tolist()
        self.table(physics.GetPrim(), tables)

    def groups(self, groups: list[dict[str, Any]]) -> None:
        """Groups of grains, spheres given by positions as points."""
        paths = unused_paths(GRAINS, [str(group.get("name", f"group_{i}")) for i, group in enumerate(groups)])
        for group, path in zip(groups, paths, strict=True):
            if "positions" in group and "clump" not in group:
                self.points(path, group)
            else:
                self.entries([group], "grains", [path])

    def points(self, path: str, group: dict[str, Any]) -> None:
        """Grains given by positions, in single precision for other programs and in double precision."""
        points = UsdGeom.Points.Define(self.stage, path)
        UsdPhysics.CollisionAPI.Apply(points.GetPrim())
        arrays = {key: np.array(group[key], dtype=float) for key in GRAIN_KEYS if key in group}
        diameters = arrays.get("diameters", 2.0 * arrays["radii"] if "radii" in arrays else None)
        if diameters is None:
            diameters = np.full(len(arrays["positions"]), group.get("diameter") or 2.0 * group["radius"])
        author_points(points, arrays["positions"], diameters, arrays.get("velocities"), arrays.get("spins"), group.get("ids"))
        for key, values in arrays.items():
            self.primvar(points, f"dem:{key}", values)
        self.table(points.GetPrim(), {key: v for key, v in group.items() if key not in (*GRAIN_KEYS, "ids")})

    def primvar(self, points: UsdGeom.Points, name: str, values: np.ndarray) -> None:
        """Author an array of float64, one entry per grain."""
        vectors = values.ndim == 2
        value_type = _NUMBERS.Double3Array if vectors else _NUMBERS.DoubleArray
        converted = (Vt.Vec3dArray if vectors else Vt.DoubleArray).FromNumpy(np.ascontiguousarray(values))
        UsdGeom.PrimvarsAPI(points).CreatePrimvar(name, value_type, UsdGeom.Tokens.vertex).Set(converted)


def author_points(
    points: UsdGeom.Points,
    positions: np.ndarray,
    diameters: np.ndarray,
    velocities: np.ndarray | None = None,
    spins: np.ndarray | None = None,
    ids: Sequence[int] | np.ndarray | None = None,
) -> None:
    """Author grains in single precision [m, m/s, rad/s], shapes (n, 3) and (n,)."""

    def vectors(values: np.ndarray) -> Vt.Vec3fArray:
        return Vt.Vec3fArray.FromNumpy(np.ascontiguousarray(values, dtype=np.float32))

    points.CreatePointsAttr(vectors(positions))
    points.CreateWidthsAttr(Vt.FloatArray.FromNumpy(np.asarray(diameters, dtype=np.float32)))
    if velocities is not None:
        points.CreateVelocitiesAttr(vectors(velocities))
    if spins is not None:
        omega = UsdGeom.PrimvarsAPI(points).CreatePrimvar("omega", _NUMBERS.Vector3fArray, UsdGeom.Tokens.vertex)
        omega.Set(vectors(spins))
    if ids is not None:
        points.CreateIdsAttr(Vt.Int64Array.FromNumpy(np.asarray(ids, dtype=np.int64)))


def _author_surface_velocity(prim: Usd.Prim, given: Any) -> None:
    """Say a constant surface velocity as PhysX does too, in the world's axes, for other programs."""
    if isinstance(given, dict) and set(given) == {"velocity"}:
        prim.AddAppliedSchema("PhysxSurfaceVelocityAPI")
        prim.CreateAttribute("physxSurfaceVelocity:surfaceVelocity", _NUMBERS.Vector3f).Set(Gf.Vec3f(*given["velocity"]))


def _is_exact_in_single(value: float) -> bool:
    """Whether a number is recovered from single precision when that is read as its shortest decimal."""
    return float(str(np.float32(value))) == value


def _typed(value: Any) -> tuple[Any, Any]:
    """Type of the attribute for a value of a table, and the value converted to that type."""
    if isinstance(value, (bool, str)):
        return (_NUMBERS.Bool if isinstance(value, bool) else _NUMBERS.String), value
    if isinstance(value, int):
        return _NUMBERS.Int64, value
    if isinstance(value, float):
        return _NUMBERS.Double, value
    if not value or isinstance(value[0], str):
        return _NUMBERS.StringArray, Vt.StringArray(value)
    numbers = np.array(value)
    if numbers.ndim == 1 and numbers.dtype.kind == "i":
        return _NUMBERS.Int64Array, Vt.Int64Array(value)
    if numbers.shape[1:] == (4,):
        return _NUMBERS.Double4Array, Vt.Vec4dArray.FromNumpy(numbers.astype(float))
    types = {2: (_NUMBERS.Double2, Gf.Vec2d, Vt.Vec2dArray), 3: (_NUMBERS.Double3, Gf.Vec3d, Vt.Vec3dArray)}
    value_type, vector, array = types.get(numbers.shape[-1], (None, None, None))
    if numbers.ndim == 2 and value_type:
        return value_type.arrayType, array.FromNumpy(numbers.astype(float))
    return (value_type, vector(*numbers.tolist())) if value_type else (_NUMBERS.DoubleArray, Vt.DoubleArray(value))
