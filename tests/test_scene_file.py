import tomllib

import pytest
import trimesh

from warpdem.core.access import access_of_file
from warpdem.errors import SceneError
from warpdem.scene.file import load_scene, scene_from_dict

GOOD = """
title = "two grains in a turning glass box"
[materials.glass]
density = "2.5 g/cm^3"
young_modulus = "50 MPa"
poisson_ratio = 0.25
[materials.steel]
density = 7800
young_modulus = 2e11
poisson_ratio = 0.3
[[pairs]]
materials = ["glass", "glass"]
restitution = 0.9
friction = 0.5
[[pairs]]
materials = ["steel", "glass"]
restitution = 0.8
[[grains]]
material = "glass"
positions = [[0, 0, 0], [0, 0, "1 mm"]]
radius = "0.5 mm"
[[grains]]
material = "glass"
[grains.fill]
wall = "box"
count = 10
diameter = { uniform = ["0.3 mm", "0.6 mm"] }
[[walls]]
name = "box"
material = "steel"
mesh = "meshes/box.stl"
scale = 0.001
[[walls]]
name = "floor"
material = "glass"
plane = { point = [0, 0, -1], normal = [0, 0, 2] }
[frame]
axis = [0, 1, 0]
schedule = [{ until = 1, rate = "30 rpm" }, { until = 2, rate = ["30 rpm", 0] }]
[time]
end = 1
[output]
interval = "20 ms"
"""


@pytest.fixture
def scene_path(tmp_path):
    (tmp_path / "meshes").mkdir()
    trimesh.creation.box().export(tmp_path / "meshes" / "box.stl")
    (tmp_path / "box.stl").mkdir()
    (tmp_path / "box.toml").write_text(GOOD)
    return tmp_path / "box.toml"


def message(path, *overrides):
    with pytest.raises(SceneError) as error:
        load_scene(path, overrides)
    text = str(error.value)
    assert error.value.exit_code == 2
    assert len(text.splitlines()) <= 24
    for noise in ("pydantic", "Input should", "union", "tag", "Value error", "~"):
        assert noise not in text
    return text


def test_good_scene_loads(scene_path):
    scene = load_scene(scene_path)
    assert scene.base == scene_path.parent
    assert scene.source == str(scene_path)
    assert scene.resolve(scene.walls[0].mesh).exists()
    assert scene.grains[1].fill.diameter.uniform == (0.0003, 0.0006)
    assert scene.materials["glass"].density == 2500.0
    assert scene.walls[1].plane.normal == (0.0, 0.0, 1.0)


def test_dict_gives_the_scene_of_the_file(scene_path):
    access = access_of_file(scene_path.parent)
    assert scene_from_dict(tomllib.loads(GOOD), scene_path.parent, str(scene_path), access) == load_scene(scene_path)


@pytest.mark.parametrize(
    ("override", "get", "value"),
    [
        ("time.end=0.5", lambda s: s.time.end, 0.5),
        ("engine.skin='0.1 mm'", lambda s: s.engine.skin, 0.0001),
        ("engine.skin=0.1 mm", lambda s: s.engine.skin, 0.0001),
        ("walls.0.scale=0.002", lambda s: s.walls[0].scale, 0.002),
        ("walls[0].scale = 0.002", lambda s: s.walls[0].scale, 0.002),
        ("gravity=[0, 0, '-1 m/s^2']", lambda s: s.gravity, (0.0, 0.0, -1.0)),
        ("contact.tangential=mindlin_displacement", lambda s: s.contact.tangential, "mindlin_displacement"),
        ("output.picture=false", lambda s: s.output.picture, False),
        ("title=a = b", lambda s: s.title, "a = b"),
        ("frame.schedule.1.until=3", lambda s: s.frame[0].schedule[1].until, 3.0),
    ],
)
def test_override_sets_one_key(scene_path, override, get, value):
    assert get(load_scene(scene_path)) != value
    assert get(load_scene(scene_path, [override])) == value


@pytest.mark.parametrize(
    ("override", "words"),
    [
        ("time.end", ["KEY=VALUE"]),
        ("=3", ["KEY=VALUE"]),
        ("walls.7.scale=1", ["walls", "list of 2", "0 to 1"]),
        ("walls.box.scale=1", ["walls", "index"]),
        ("time.end.x=1", ["time.end = 1", "no keys"]),
        ("gravity=[0, 0", ["not valid TOML"]),
    ],
)
def test_wrong_override_is_named(scene_path, override, words):
    text = message(scene_path, override)
    for word in [override.split("=")[0], *words]:
        assert word in text


BAD = [
    # unknown keys
    ("time.edn=3", ["time.edn = 3", "unknown key", '"end"']),
    ("materials.glass.densty=3", ["materials.glass.densty", '"density"']),
    ("grains.1.fill.diameter={unifrom=[1, 2]}", ["grains[1].fill.diameter.unifrom", '"uniform"']),
    ("frame.schedule.0.untill=1", ["frame.schedule[0].untill", '"until"']),
    ("interval=3", ["interval = 3", "exists as output.interval"]),
    ("walls.0.friction=0.3", ["walls[0].friction", "exists as pairs[].friction"]),
    ("zzz=1", ["zzz", "known here: title, gravity, materials"]),
    ("base=x", ["base", "unknown key"]),
    ("source=x", ["source", "unknown key"]),
    ("access={}", ["access", "unknown key"]),
    # types and ranges
    ("time=3", ["time = 3", "table", "[time]"]),
    ("walls={}", ["walls", "[[walls]]"]),
    ("materials.glass=3", ["materials.glass = 3", "table"]),
    ("title=3", ["title = 3", "string"]),
    ("output.picture=1", ["output.picture = 1", "true or false"]),
    ("output.formats=vtk", ["output.formats", "list"]),
    ("output.formats=['vtk', 'obj']", ["output.formats[1]", '"vtk", "vtkhdf" or "usd"']),
    ("output.formats=['vtk', 'vtk']", ["output.formats", "once"]),
    ("output.interval=0", ["output.interval = 0", "> 0"]),
    ("output.history_interval=-1", ["output.history_interval", "> 0"]),
    ("time.end=-1", ["time.end = -1", "> 0 [s]"]),
    ("time.end=true", ["time.end = true", "time", "[s]"]),
    ("time.end=nan", ["time.end", "finite"]),
    ("time.step=atuo", ['time.step = "atuo"', '"auto"']),
    ("time.step=3", ["time.step", "time.end = 1 s"]),
    ("time.max_speed='3 m'", ["time.max_speed", "speed", "[m/s]"]),
    ("engine.skin=0", ["engine.skin = 0", "> 0", '"auto"']),
    ("engine.max_overlap=2", ["engine.max_overlap", "<= 1"]),
    ("contact.normal=herz", ["contact.normal", '"hertz", "hertz_clamped"', 'mean "hertz"']),
    ("contact.torsion=true", ["contact.torsion", "rolling"]),
    ("materials.glass.poisson_ratio=0.6", ["materials.glass.poisson_ratio = 0.6", "> -1 and <= 0.5"]),
    ("materials.glass.poisson_ratio=-1", ["> -1 and <= 0.5"]),
    ("materials.glass.density='3 m'", ["density", "[kg/m3]", '"m" is not a density']),
    ("materials.glass.young_modulus=0", ["young_modulus = 0", "> 0"]),
    ("pairs.0.restitution=0", ["pairs[0].restitution = 0", "> 0 and <= 1"]),
    ("pairs.0.restitution=1.1", ["pairs[0].restitution", "> 0 and <= 1"]),
    ("pairs.0.friction=-1", ["pairs[0].friction = -1", ">= 0"]),
    ("pairs.0.materials=['glass']", ["pairs[0].materials", "2 or more"]),
    ("gravity=9.81", ["gravity = 9.81", "list of 3", "[m/s2]"]),
    ("gravity=[0, 0, '3 m']", ["gravity[2]", "acceleration"]),
    # units of the frame
    ("frame.schedule.0.rate='30 Hz'", ["frame.schedule[0].rate", "rpm or rad/s"]),
    ("frame.schedule.0.rate=[1, '30 Hz']", ["frame.schedule[0].rate[1]", "rpm or rad/s"]),
    ("frame.schedule.0.rate=[1, 2, 3]", ["frame.schedule[0].rate", "list of 2"]),
    ("frame.schedule.0.until='30 rpm'", ["frame.schedule[0].until", "time"]),
    ("frame.schedule.0.until=5", ["frame.schedule[1].until = 2", "later than 5 s"]),
    ("frame.schedule.0={rate=1}", ["frame.schedule[0].until", "only the last"]),
    ("frame.schedule.1={rate=[1, 2]}", ["frame.schedule[1].until", "ramp must end"]),
    ("frame.schedule=[]", ["frame.schedule", "1 or more"]),
    ("frame.rate=1", ["frame", "exactly one of rate, schedule"]),
    ("frame.axis=[0, 0, 0]", ["frame.axis", "zero vector"]),
    # names and pairs
    ("walls.0.material=stell", ["walls[0].material", '"stell"', '"glass", "steel"']),
    ("grains.0.material=sand", ["grains[0].material", '"glass", "steel"']),
    ("pairs.0.materials=['glass', 'sand']", ["pairs[0].materials[1]", '"glass", "steel"']),
    ("grains.0.material=steel", ["pairs", "no coefficients", 'materials = ["steel", "steel"]']),
    ("walls.1.name=box", ["walls[1].name", "walls[0]"]),
    ("walls.0.name=a b", ["walls[0].name", "letters"]),
    ("pairs.1.materials=['glass', 'glass']", ["pairs[1].materials", "pairs[0]"]),
    ("pairs=[]", ['["glass", "glass"]; materials = ["glass", "steel"]']),
    ("grains.1.fill.wall=bix", ["grains[1].fill.wall", "no such wall", '"box"']),
    ("grains.1.fill.wall=floor", ["grains[1].fill.wall", "analytic shape", '"box"']),
    # laws and coefficients
    ("contact.normal=hooke", ["pairs[0].stiffness", "pairs[1].stiffness", "hooke", "[N/m]"]),
    ("pairs.0.stiffness=5", ["pairs[0].stiffness = 5", '"hertz"']),
    ("pairs.0.tangential_stiffness_ratio=0.5", ["pairs[0].tangential_stiffness_ratio", "hooke"]),
    ("contact.tangential=none", ["pairs[0].friction = 0.5", "friction = 0", "tangential law"]),
    ("pairs.0.rolling_friction=0.1", ["pairs[0].rolling_friction", "rolling_friction = 0", "rolling law"]),
    ("pairs.0.rolling_damping=0.1", ["pairs[0].rolling_damping", '"spring"']),
    # groups and sources
    ("grains=[]", ["grains", "give at least one group of grains, a stream, or a start"]),
    ("grains.0={material='glass'}", ["grains[0]", "exactly one of positions, file, fill", "none"]),
    ("grains.0.file=a.npz", ["grains[0]", "exactly one", "positions and file"]),
    ("grains.0.diameter=1", ["grains[0]", "exactly one", "radius and diameter"]),
    ("grains.1.radius=1", ["grains[1].radius", "positions", "fill"]),
    ("grains.0={material='glass', file='a.txt'}", ["grains[0].file", ".npz, .csv, .vtp"]),
    ("grains.0.radius=0", ["grains[0].radius = 0", "> 0"]),
    ("grains.0.positions=[[0, 0], [1, 1]]", ["grains[0].positions", "rows of 3"]),
    ("grains.0.velocities=[[0, 0, 1]]", ["grains[0].velocities", "positions (2)"]),
    ("grains.0.ids=[4, 4]", ["grains[0].ids", "unique", "4"]),
    ("grains.1.fill.solid_fraction=0.5", ["grains[1].fill", "exactly one of count, mass, solid_fraction"]),
    ("grains.1.fill.mass='3 mm'", ["grains[1].fill.mass", "must be a mass"]),
    ("grains.1.fill.diameter={table=[[1, 1], ['2 kg', 3]]}", ["grains[1].fill.diameter.table[1][0]", "length"]),
    ("grains.1.fill.diameter={uniform=[1, 2], normal={mean=1, deviation=1, min=1, max=2}}", ["exactly one of uniform, normal"]),
    ("grains.1.fill.count=1.5", ["grains[1].fill.count = 1.5", "whole number"]),
    ("grains.1.fill.count=0", ["grains[1].fill.count = 0", ">= 1"]),
    ("grains.1.fill.seed=-1", ["grains[1].fill.seed = -1", ">= 0"]),
    ("grains.1.fill.diameter={uniform=[2, 1]}", ["grains[1].fill.diameter.uniform", "above"]),
    ("grains.1.fill.region={min=[0, 0, 0], max=[1, 1, 0]}", ["grains[1].fill.region.max", "above min"]),
    ("grains.1.fill.box={min=[0, 0, 0], max=[1, 1, 1]}", ["exactly one of wall, tile, box", "wall and box"]),
    ("walls.1.mesh=meshes/box.stl", ["walls[1]", "exactly one of mesh, plane"]),
    ("walls.1.scale=2", ["walls[1].scale = 2", "mesh"]),
    ("walls.0.scale=-1", ["walls[0].scale = -1", "> 0"]),
    ("walls.1.surface_velocity=[1, 2]", ["walls[1].surface_velocity.velocity", "list of 3"]),
    ("walls.1.surface_velocity=['1 rpm', 0, 0]", ["walls[1].surface_velocity.velocity[0]", "a speed"]),
    ("walls.1.surface_velocity={axis=[0, 1, 0]}", ["walls[1].surface_velocity", "exactly one of speed, schedule, table"]),
    ("walls.1.surface_velocity={axis=[0, 0, 0], speed=1}", ["walls[1].surface_velocity.axis", "zero vector"]),
    ("walls.1.surface_velocity={axis=[0, 1, 0], spead=1}", ["surface_velocity.spead", 'did you mean "speed"']),
    (
        "walls.1.surface_velocity={axis=[0, 1, 0], schedule=[{speed=[0, 1]}]}",
        ["walls[1].surface_velocity.schedule[0].until", "a ramp must end"],
    ),
    (
        "walls.1.surface_velocity={axis=[0, 1, 0], table=[[1, 1], [0, 1]]}",
        ["walls[1].surface_velocity.table[1][0] = 0", "later than 1 s"],
    ),
    ("walls.0.scale=[1, 2]", ["walls[0].scale", "list of 3"]),
    ("walls.0.scale=[1, 2, -1]", ["walls[0].scale[2] = -1", "> 0"]),
    ("walls.0={name='a', material='glass', mesh='a.ply', part='lid'}", ["walls[0].part", ".stl, .obj", "a PLY file has none"]),
    ("walls.0={name='a', material='glass', mesh='a.usd', part='lid'}", ["walls[0].part", ".stl, .obj", "give prim"]),
    ("walls.0.scale='3 mm'", ["walls[0].scale", "pure number"]),
    # files
    ("walls.0.mesh=meshes/bx.stl", ["walls[0].mesh", "bx.stl", "no such file", "similar files there: box.stl"]),
    ("walls.0.mesh=mesh/box.stl", ["walls[0].mesh", "no folder"]),
    ("walls.0.mesh=box.stl", ["walls[0].mesh", "is a folder"]),
    ("walls.0.mesh=meshes", ["walls[0].mesh", "must be a file ending in .stl, .obj, .ply, .usd, .usda, .usdc, .usdz"]),
    ("walls.0.prim=/World/Drum", ["walls[0].prim", "only for a mesh from USD", ".usdz"]),
    ("walls.0.prim=World", ["walls[0].prim"]),
    ("grains.0={material='glass', file='bed.npz'}", ["grains[0].file", "bed.npz", "no such file"]),
]


@pytest.mark.parametrize(("override", "words"), BAD, ids=[case[0] for case in BAD])
def test_bad_scene_is_answered_by_key_value_and_what_is_allowed(scene_path, override, words):
    text = message(scene_path, override)
    for word in [str(scene_path), *words]:
        assert word in text


def test_id_of_another_group_is_refused(scene_path):
    other = "grains.1={material='glass', positions=[[1, 1, 1]], radius=0.1, ids=[4]}"
    text = message(scene_path, other, "grains.0.ids=[3, 4]")
    assert "grains[1].ids = 4" in text
    assert "grains[0]" in text


def test_region_needs_a_wall(scene_path):
    box = "{min=[0, 0, 0], max=[1, 1, 1]}"
    text = message(scene_path, f"grains.1.fill={{box={box}, region={box}, count=1, diameter=0.1}}")
    assert "grains[1].fill.region" in text


def test_missing_keys_say_what_they_are(scene_path):
    text = message(scene_path, "time={}", "materials.steel={density=1}")
    assert "time.end\n      missing: End of the run [s], > 0" in text
    assert "materials.steel.young_modulus" in text


def test_material_may_bear_the_name_of_a_key(scene_path):
    text = message(scene_path, "materials.density={densty=1}")
    assert 'materials.density.densty = 1\n      unknown key; did you mean "density"?' in text


def test_many_problems_fill_one_screen_at_most(scene_path):
    text = message(scene_path, *[f"k{i}=1" for i in range(40)])
    assert "40 problems" in text
    assert "... and 33 more" in text


def test_long_values_are_shortened(scene_path):
    text = message(scene_path, "title=[" + "1," * 1000 + "]", "gravity='" + "x" * 500 + "'")
    assert max(map(len, text.splitlines())) < 200
    assert "1000 entries" in text


def test_toml_mistake_is_named_with_its_line(scene_path):
    scene_path.write_text('title = "x"\nend =\n')
    text = message(scene_path)
    assert f"{scene_path}, line 2, column" in text
    assert "end =" in text


def test_missing_scene_names_similar_files(scene_path):
    text = message(scene_path.with_name("bux.toml"))
    assert "bux.toml: no such file" in text
    assert "box.toml" in text
    assert "no folder" in message(scene_path.parent / "nowhere" / "box.toml")


def test_folder_and_binary_file_are_no_scenes(scene_path):
    assert "folder" in message(scene_path.parent)
    scene_path.write_bytes(b"\xff\xfe\x00")
    assert "UTF-8" in message(scene_path)
