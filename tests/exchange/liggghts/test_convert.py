"""Scripts of LIGGGHTS as scenes; *against* LIGGGHTS's own formulas and order of operations, done by hand."""

import math
import tomllib

import numpy as np
import pytest
import trimesh

from warpdem import SceneError, load_scene
from warpdem.app import cli
from warpdem.exchange.liggghts.convert import convert_script
from warpdem.mesh.triangle_mesh import load_mesh

HEAD = """units si
boundary f p m
region reg block -1 1 -0.5 0.5 0 2 units box
create_box 2 reg
fix m1 all property/global youngsModulus peratomtype 5.e6 6.e6
fix m2 all property/global poissonsRatio peratomtype 0.45 0.3
fix m3 all property/global coefficientRestitution peratomtypepair 2 0.9 0.8 0.8 0.7
fix m4 all property/global coefficientFriction peratomtypepair 2 0.1 0.2 0.2 0.3
fix m5 all property/global coefficientRollingFriction peratomtypepair 2 0.01 0.02 0.02 0.03
"""
GRAINS = """fix pts all particletemplate/sphere 1 atom_type 1 density constant 2500 radius constant 0.01
fix pdd all particledistribution/discrete 2 1 pts 1.0
region bc block -0.2 0.2 -0.2 0.2 0.5 1
fix ins all insert/pack seed 3 distributiontemplate pdd insert_every once region bc particles_in_region 20
"""
TAIL = """fix 1 all nve/sphere
fix grav all gravity 9.81 vector 0 0 -2
timestep 1e-5
dump d all custom/vtk 100 post/a*.vtk id
thermo 50
run 1000
"""
HERTZ = "pair_style gran model hertz tangential history rolling_friction cdt\n"
WALL = "model hertz tangential history rolling_friction cdt"


def write_box(path, low, high):
    trimesh.creation.box(bounds=[low, high]).export(path)


@pytest.fixture
def convert(tmp_path):
    """Writes a script, converts it; returns the tables and the notes."""

    def of(*parts, complete=True):
        (tmp_path / "in.test").write_text("".join(parts))
        notes = convert_script(tmp_path / "in.test", tmp_path / "scene.toml", overwrite=True)
        text = (tmp_path / "scene.toml").read_text()
        for note in notes:
            assert f"#   {note.splitlines()[0]}" in text
        if complete:
            load_scene(tmp_path / "scene.toml")
            assert not any("not complete" in note for note in notes)
        return tomllib.loads(text), notes

    return of


def test_materials_pairs_law_and_time(convert):
    scene, notes = convert(HEAD, HERTZ, GRAINS, TAIL)
    assert scene["gravity"] == [0.0, 0.0, -9.81]
    assert scene["contact"] == {"normal": "hertz", "tangential": "mindlin_displacement", "rolling": "constant"}
    assert scene["materials"]["type1"] == {"density": 2500.0, "young_modulus": 5e6, "poisson_ratio": 0.45}
    assert scene["pairs"][1] == {
        "materials": ["type1", "type2"], "restitution": 0.8, "friction": 0.2, "rolling_friction": 0.02
    }  # fmt: skip
    assert scene["time"] == {"end": pytest.approx(0.01)}
    assert scene["output"] == {"interval": pytest.approx(1e-3), "history_interval": pytest.approx(5e-4)}
    assert scene["borders"] == {
        "x": {"kind": "open", "min": -1.0, "max": 1.0}, "y": {"kind": "periodic", "min": -0.5, "max": 0.5}
    }  # fmt: skip
    fill = scene["grains"][0]["fill"]
    assert fill == {"box": {"min": [-0.2, -0.2, 0.5], "max": [0.2, 0.2, 1.0]}, "diameter": 0.02, "count": 20}
    assert any("density" in note and "type 2" in note for note in notes)


@pytest.mark.parametrize(
    ("style", "normal", "notes_of"),
    [
        ("hertz tangential history limitForce on", "hertz_clamped", None),
        ("hertz tangential off", "hertz", None),
        ("hertz tangential history cohesion sjkr2", "hertz", "cohesion sjkr2"),
        ("hertz tangential history rolling_friction epsd2", "hertz", "epsd2"),
        ("hertz tangential no_history", "hertz", "no_history"),
    ],
)
def test_laws(convert, style, normal, notes_of):
    scene, notes = convert(HEAD, f"pair_style gran model {style}\n", GRAINS, TAIL)
    assert scene["contact"]["normal"] == normal
    assert notes_of is None or any(notes_of in note for note in notes)
    assert (scene["contact"]["tangential"] == "none") == ("off" in style)


def test_cohesion(convert):
    density = "fix m6 all property/global cohesionEnergyDensity peratomtypepair 2 1e4 2e4 2e4 3e4\n"
    scene, _ = convert(HEAD, density, "pair_style gran model hertz tangential history cohesion sjkr\n", GRAINS, TAIL)
    assert scene["contact"]["normal"] == "sjkr"
    assert [pair["cohesion_energy_density"] for pair in scene["pairs"]] == [1e4, 2e4, 3e4]


def test_linear_springs_by_the_characteristic_velocity(convert):
    more = """fix m6 all property/global characteristicVelocity scalar 2.
fix m7 all property/global coefficientMaxElasticStiffness peratomtypepair 2 2 2 2 2
fix m8 all property/global coefficientAdhesionStiffness peratomtypepair 2 0.2 0.2 0.2 0.2
fix m9 all property/global coefficientPlasticityDepth peratomtypepair 2 0.05 0.05 0.05 0.05
"""
    scene, notes = convert(HEAD, more, "pair_style gran model hooke/hysteresis tangential history\n", GRAINS, TAIL)
    pair = scene["pairs"][0]
    # two grains of 1 cm: R* = 5 mm, m* half of the mass, E* = E / (2 (1 - nu^2))
    reduced, mass = 0.005, 0.5 * 2500 * 4 / 3 * math.pi * 1e-6
    modulus = 5e6 / (2 * (1 - 0.45**2))
    stiffness = 16 / 15 * math.sqrt(reduced) * modulus * (15 * mass * 4 / (16 * math.sqrt(reduced) * modulus)) ** 0.2
    assert pair["stiffness"] == pytest.approx(stiffness, rel=1e-12)
    assert pair["unloading_stiffness"] == pytest.approx(2 * stiffness)
    assert pair["adhesion_stiffness"] == pytest.approx(0.2 * stiffness)
    assert (pair["plasticity_depth"], pair["tangential_stiffness_ratio"]) == (0.05, 1.0)
    assert any("characteristic velocity 2 m/s" in note for note in notes)


def test_a_mesh_is_put_where_liggghts_puts_it(convert, tmp_path):
    write_box(tmp_path / "box.stl", (0.0, 0.0, 0.0), (1.0, 2.0, 3.0))
    words = "move 1 2 3 scale 0.1 rotate axis 0 0 1 angle 90 rotate axis 1 0 0 angle 30 move 0 0.5 0"
    mesh = f"fix cad all mesh/surface file box.stl type 2 {words}\nfix w all wall/gran {WALL} mesh n_meshes 1 meshes cad\n"
    scene, _ = convert(HEAD, HERTZ, mesh, GRAINS, TAIL)
    wall = load_scene(tmp_path / "scene.toml").walls[0]
    placed = load_mesh(tmp_path / "box.stl", wall.scale, wall.rotate, wall.translate).vertices
    corners = 0.1 * (load_mesh(tmp_path / "box.stl").vertices + np.array([1, 2, 3]))
    corners = np.stack([-corners[:, 1], corners[:, 0], corners[:, 2]], axis=1)
    s, c = math.sin(math.pi / 6), math.cos(math.pi / 6)
    corners = corners @ np.array([[1, 0, 0], [0, c, -s], [0, s, c]]).T + np.array([0, 0.5, 0])
    order = [np.lexsort(points.round(9).T) for points in (placed, corners)]
    assert np.allclose(placed[order[0]], corners[order[1]], atol=1e-12)
    assert scene["walls"][0]["material"] == "type2" and "open" not in scene["walls"][0]


def test_walls_that_are_planes_and_cylinders_face_the_domain(convert):
    walls = f"""fix a all wall/gran {WALL} primitive type 2 zplane 0.0
fix b all wall/gran {WALL} primitive type 2 xplane 1.0
fix c all wall/gran {WALL} primitive type 2 zcylinder 0.3 0. 0.1
fix d all wall/gran {WALL} primitive type 2 ycylinder 0.1 0.5 0.
"""
    scene, _ = convert(HEAD, HERTZ, walls, GRAINS, TAIL)
    a, b, c, d = scene["walls"]
    assert a["plane"] == {"point": [0, 0, 0], "normal": [0, 0, 1]} and b["plane"]["normal"] == [-1, 0, 0]
    assert c["cylinder"] == {"point": [0, 0.1, 0], "axis": [0, 0, 1], "radius": 0.3}
    assert d["cylinder"] == {"point": [0.5, 0, 0], "axis": [0, 1, 0], "radius": 0.1, "inside": False}


MESH = f"fix cad all mesh/surface file box.stl type 1\nfix w all wall/gran {WALL} mesh n_meshes 1 meshes cad\n"


def test_motions_one_after_the_other(convert, tmp_path):
    write_box(tmp_path / "box.stl", (0.0, 0.0, 0.0), (1.0, 2.0, 3.0))
    moves = """timestep 1e-3
run 500
fix a all move/mesh mesh cad linear 1 0 0
run 100
unfix a
fix b all move/mesh mesh cad rotate origin 1 0 0 axis 0 1 0 period 2.
run 100
"""
    scene, _ = convert(HEAD, HERTZ, MESH, GRAINS, moves)
    rotation, shift = scene["walls"][0]["motion"]  # outermost first: the axis is at rest
    assert shift == {"velocity": [1, 0, 0], "start": pytest.approx(0.5), "until": pytest.approx(0.6)}
    assert rotation == {"axis": [0, 1, 0], "origin": [1, 0, 0], "rate": pytest.approx(math.pi), "start": pytest.approx(0.6)}


def test_motions_at_the_same_time_and_oscillations(convert, tmp_path):
    write_box(tmp_path / "box.stl", (0.0, 0.0, 0.0), (1.0, 2.0, 3.0))
    moves = """fix a all move/mesh mesh cad wiggle amplitude -0.1 0 0 period 0.02
fix b all move/mesh mesh cad riggle origin 0 0 0 axis 0 0 1 period 0.5 amplitude 30
fix c all move/mesh mesh cad linear/variable v_x v_y v_z
"""
    scene, notes = convert(HEAD, HERTZ, MESH, moves, GRAINS, TAIL)
    wiggle, riggle = scene["walls"][0]["motion"]
    assert wiggle == {"amplitude": [-0.1, 0, 0], "frequency": pytest.approx(50)}
    wave = riggle["sinusoid"]
    assert wave["amplitude"] == pytest.approx(math.radians(30) * 2 * math.pi / 0.5)
    assert wave["phase"] == pytest.approx(math.pi / 2)
    assert any("fix c all move/mesh" in note and "this motion is not converted" in note for note in notes)


def test_a_stream_through_a_face_with_two_sizes(convert, tmp_path):
    write_box(tmp_path / "face.stl", (0.0, 0.0, 0.0), (1.0, 1.0, 0.1))
    insertion = """fix p1 all particletemplate/sphere 1 atom_type 1 density constant 2500 radius constant 0.005
fix p2 all particletemplate/sphere 1 atom_type 1 density constant 2500 radius uniform 0.01 0.02
fix p3 all particletemplate/sphere 1 atom_type 1 density constant 2500 radius constant 0.015
fix pdd all particledistribution/discrete 1 2 p1 0.3 p2 0.7
fix two all particledistribution/discrete/numberbased 1 2 p3 0.4 p1 0.6
fix inface all mesh/surface file face.stl type 1 scale 0.5
fix ins all insert/stream seed 1 distributiontemplate pdd mass INF massrate 2. vel constant 0 0 -1 insertion_face inface
fix rate all insert/rate/region seed 1 distributiontemplate two nparticles 50 particlerate 100 start 300 region c
"""
    region = "region c cylinder z 0.1 0.2 0.3 0.4 0.9\n"
    scene, _ = convert(HEAD, HERTZ, region, insertion, TAIL, complete=False)
    first, second = scene["streams"]
    assert first["face"] == {"file": "face.stl", "scale": 0.5}
    assert (first["mass_rate"], first["velocity"], "mass" in first) == (2.0, [0, 0, -1], False)
    assert [portion["mass_share"] for portion in first["recipe"]] == [0.3, 0.7]
    assert first["recipe"][1]["diameter"] == {"uniform": [0.02, 0.04]}
    assert second["diameter"] == {"table": [[0.01, 0.6], [0.03, 0.4]], "by": "number"}
    assert second["cylinder"] == {"point": [0.1, 0.2, 0.4], "axis": [0, 0, 1], "radius": 0.3, "length": pytest.approx(0.5)}
    assert (second["count_rate"], second["count"], second["start"]) == (100, 50, pytest.approx(3e-3))


def test_shares_of_a_packing_by_number(convert):
    grains = """fix p1 all particletemplate/sphere 1 atom_type 1 density constant 2000 radius constant 0.01
fix p2 all particletemplate/sphere 1 atom_type 2 density constant 1000 radius constant 0.02
fix pdd all particledistribution/discrete 1 2 p1 0.5 p2 0.5
region bc block -0.2 0.2 -0.2 0.2 0.5 1
fix ins all insert/pack seed 3 distributiontemplate pdd insert_every once region bc particles_in_region 100
"""
    scene, _ = convert(HEAD, HERTZ, grains, TAIL)
    # equal masses: the grains of type 2 weigh four times as much, so 80 of 100 are of type 1
    assert [(entry["material"], entry["fill"]["count"]) for entry in scene["grains"]] == [("type1", 80), ("type2", 20)]


def test_a_region_that_is_topped_up_is_a_stream(convert):
    again = GRAINS.replace("insert_every once", "insert_every 400 vel constant 0 0 -0.2")
    scene, notes = convert(HEAD, HERTZ, again, TAIL)
    stream = scene["streams"][0]
    assert (stream["count_rate"], stream["count"]) == (pytest.approx(20 / 4e-3), 60)
    assert any("topped up" in note for note in notes)


def test_what_is_not_converted_is_named_with_its_line(convert):
    more = "fix heat all heat/gran initial_temperature 300\nvelocity all create 1 2\nread_data a.data\n"
    _, notes = convert(HEAD, HERTZ, GRAINS, more, TAIL)
    assert any("fix heat all heat/gran ...: not converted" in note for note in notes)
    assert any("in.test line 16: velocity all create 1 ...: not converted" in note for note in notes)
    assert any("read_data a.data" in note and "warpdem grains" in note for note in notes)


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("units si", "units cgs", "only scripts in si"),
        ("pair_style gran model hertz", "pair_style lj/cut", "pair_style lj/cut"),
        ("model hertz", "model hertz/stiffness", "converted are hertz, hooke"),
        ("youngsModulus", "modulus", "youngsModulus"),
        ("peratomtypepair 2 0.9 0.8 0.8 0.7", "peratomtypepair 2 0.9 0.8", "needs 4 values"),
        ("gravity 9.81", "gravity abc", "abc"),
        ("run 1000", "", "no run"),
        ("region bc particles", "region elsewhere particles", "no region elsewhere"),
        ("distributiontemplate pdd", "distributiontemplate other", "no distribution other"),
        ("fix 1 all nve/sphere", "fix 1", "lacks words"),
    ],
)
def test_scripts_that_cannot_be_converted(tmp_path, old, new, words):
    text = HEAD + HERTZ + GRAINS + TAIL
    assert old in text
    (tmp_path / "in.test").write_text(text.replace(old, new))
    with pytest.raises(SceneError, match=words):
        convert_script(tmp_path / "in.test", tmp_path / "scene.toml")
    assert not (tmp_path / "scene.toml").exists()


def test_the_command_takes_a_script(tmp_path, capsys):
    (tmp_path / "in.test").write_text(HEAD + HERTZ + GRAINS + TAIL)
    cli.app(["convert", str(tmp_path / "in.test"), str(tmp_path / "scene.toml")], result_action="return_value")
    assert "note: timestep 1e-05 s" in capsys.readouterr().out
    assert load_scene(tmp_path / "scene.toml").pairs[0].restitution == 0.9
