"""What check says: each limit of the time step against its closed form, warnings with numbers, estimates against the run."""

import io
import json
import math
from pathlib import Path
from unittest.mock import Mock

import pytest
import trimesh
import warp as wp
from rich.console import Console
from warpdem.kernels.normal import hertz

from warpdem import Scene, SceneError, Simulation
from warpdem.app import check, scene_warnings, step_limits
from warpdem.app.run import run_scene

STEP = 1e-5
CUP = str(Path(__file__).resolve().parent.parent / "scenes" / "meshes" / "hopper.stl")
PLACED = {"scale": 1e-3, "translate": [1, 0, 0], "open": True}
FIELDS = [
    {"model": "harmonic", "parameters": {"stiffness": 2.0}},
    {"model": "drag", "parameters": {"coefficient": 1e-4}},
    {"model": "lorentz", "parameters": {"charge": 1e-3, "magnetic": [0, 3, 4]}},
]


def scene(**changes) -> Scene:
    """Two grains above a floor."""
    data = {
        "materials": {"g": {"density": 2500, "young_modulus": 5e6, "poisson_ratio": 0.3}},
        "contact": {"tangential": "none"},
        "pairs": [{"materials": ["g", "g"], "restitution": 0.5}],
        "grains": [{"material": "g", "radius": 1e-3, "positions": [[0, 0, 2e-3], [5e-3, 0, 2e-3]]}],
        "walls": [{"name": "floor", "material": "g", "plane": {"point": [0, 0, 0], "normal": [0, 0, 1]}}],
        "time": {"end": 0.01, "step": STEP, "max_speed": 0.1},
        "output": {"formats": ["vtk", "usd"], "interval": 2e-3, "picture": False},
    }
    return Scene.model_validate(data | changes)


def simulation(**changes) -> Simulation:
    return Simulation(scene(**changes), device="cpu", threads=1)


def said(**changes) -> str:
    return "\n".join(scene_warnings.warnings(simulation(**changes)))


def test_each_limit_has_its_time_and_the_share_of_the_step():
    sim = simulation(frame={"axis": [0, 0, 1], "rate": -20.0}, fields=FIELDS)
    rows = {row["key"]: row for row in step_limits.limit_rows(sim)}
    mass = 2500 * 4 / 3 * math.pi * 1e-9
    fastest = max(math.sqrt(2.0 / mass), 1e-4 / mass, 1e-3 * 5.0 / mass)
    wanted = {
        "rayleigh": sim.limits.rayleigh,
        "contact": sim.limits.contact_time,
        "bed": sim.limits.settled,
        "impact": sim.limits.stable,
        "frame": 1.0 / 20.0,
        "fields": 1.0 / fastest,
        "skin": 0.5 * sim.lists.skin / 0.1,
    }
    assert rows.pop("travel")["seconds"] is None, "there is no mesh"
    assert rows.keys() == wanted.keys()
    for name, seconds in wanted.items():
        assert rows[name]["seconds"] == pytest.approx(seconds, rel=1e-12), name
        assert rows[name]["share"] == pytest.approx(STEP / seconds, rel=1e-12), name


def test_a_sound_scene_has_no_warnings_and_no_limit_that_is_not_there():
    sim = simulation()
    assert scene_warnings.warnings(sim) == []
    assert [row["key"] for row in step_limits.limit_rows(sim) if row["seconds"] is None] == ["frame", "fields", "travel"]


def pairs(restitution):
    return [{"materials": ["g", "g"], "restitution": restitution}]


SHORT = {"end": 0.01, "step": 1e-6, "max_speed": 0.1}
WARNED = {
    "large step": ({"time": {"end": 0.01, "step": 1e-4, "max_speed": 1.0}}, ["time.step = 0.0001 s", "0.88 of", "auto"]),
    "few steps": (
        {"time": {"end": 0.01, "step": 6e-5, "max_speed": 1.0}},
        ["give back 0.49", "at worst", "restitution = 0.5 is asked for", "4.9 steps", "at most"],
    ),
    "soft": ({"time": {"end": 0.01, "step": 1e-6, "max_speed": 4.0}}, ["of the radius", "young_modulus", "max_overlap = 0.1"]),
    "bed": (
        {"grains": [{"material": "g", "positions": [[0, 0, 1e-3], [0, 0, 0.9]], "radius": 1e-3}],
         "time": {"end": 0.01, "step": 1e-4, "max_speed": 0.1}},
        ["of the bed at rest: its grains vibrate, and above 1.25 times the limit", "take at most"],
    ),
    "frame": ({"frame": {"axis": [0, 0, 1], "rate": 6000.0}}, ["0.06 rad per step", "at most 3.3e-06 s"]),
    "fields": ({"fields": [{"model": "drag", "parameters": {"coefficient": 1.0}}]}, ["external fields", "0.95 rad per step"]),
    "restitution": ({"pairs": pairs(0.02)}, ["pairs[0].restitution = 0.02", "0.05 or more"]),
    "jumps": (
        {"contact": {"normal": "dmt", "tangential": "none"}, "pairs": [{**pairs(0.5)[0], "surface_energy": 1e-3}],
         "engine": {"integrator": "rk4"}, "time": SHORT},
        ['engine.integrator = "rk4"', 'contact.normal = "dmt" jumps', '"exact_drift"'],
    ),
    "sizes": (
        {"grains": [{"material": "g", "radii": [1e-3, 2e-2], "positions": [[0, 0, 2e-3], [0.05, 0, 0.03]]}]},
        ["20 times the smallest, 0.002 m wide"],
    ),
    "density": (
        {"materials": {"g": {"density": 2.65, "young_modulus": 5e6, "poisson_ratio": 0.3}}, "time": SHORT},
        ["materials.g.density = 2.65 kg/m3", '"2.65 g/cm3"'],
    ),
    "modulus": (
        {"materials": {"g": {"density": 2500, "young_modulus": 50, "poisson_ratio": 0.3}}, "time": SHORT},
        ["materials.g.young_modulus = 50 Pa is that of no solid (softest gels some 1000)", '"50 MPa"'],
    ),
    "size of a mesh": (
        {"walls": [{"name": "cup", "material": "g", "mesh": CUP, "open": True, "scale": 0.1}]},
        ["walls[0].mesh: hopper.stl: the mesh is", "diameters, usual are 3 to 1000", "scale by 0.001"],
    ),
    "angle": (
        {"walls": [{"name": "cup", "material": "g", "mesh": CUP, "rotate": {"axis": [1, 0, 0], "angle": 90}} | PLACED]},
        ["walls[0].rotate.angle = 90 rad is more than a full turn (5157 degrees)", '"90 deg"'],
    ),
    "phase": (
        {"frame": [{"axis": [0, 0, 1], "rate": 1}, {"amplitude": [0, 0, 1e-3], "frequency": 1, "phase": -45}]},
        ["frame[1].phase = -45 rad", '"-45 deg"'],
    ),
    "phase of a rate": (
        {"frame": {"axis": [0, 0, 1], "sinusoid": {"amplitude": 1, "frequency": 1, "phase": 10}}},
        ["frame.sinusoid.phase = 10 rad", '"10 deg"'],
    ),
    "skin": ({"engine": {"skin": 1.9e-5}}, ["in 9.5 steps", "engine.skin"]),
}


@pytest.mark.parametrize("kind", WARNED)
def test_warning_names_number_and_remedy(kind):
    changes, words = WARNED[kind]
    text = said(**changes)
    for word in words:
        assert word in text, text


def beside_a_box(tmp_path, at, other=(), **changes) -> str:
    """Warnings for two grains, the first at ``at``, and a box of 40 mm."""
    trimesh.creation.box((0.04, 0.04, 0.04)).export(tmp_path / "vessel.stl")
    vessel = {"name": "vessel", "material": "g", "mesh": str(tmp_path / "vessel.stl")}
    second = [at[0], at[1] + 0.003, at[2]]
    grains = [{"material": "g", "radius": 1e-3, "positions": [at, second]} | changes.pop("moving", {})]
    return said(grains=grains, walls=[vessel, *other], time=SHORT, **changes)


def test_grains_that_no_vessel_holds_are_told(tmp_path):
    text = beside_a_box(tmp_path, [0.06, 0, 0])
    assert "all 2 grains, from (0.06, 0, 0) to (0.06, 0.003, 0) m, are outside the closed mesh 'vessel' (from (-0.02," in text
    below = beside_a_box(tmp_path, [0, 0, -0.03])
    assert "outside the closed mesh 'vessel'" in below
    assert below == beside_a_box(tmp_path, [0, 0, -0.03], gravity=[0, 0, 0])
    assert "outside the closed mesh 'vessel'" in beside_a_box(tmp_path, [0, 0, 0.03], gravity=[0, 0, 9.81])


def test_a_solid_body_that_grains_meet_is_no_lost_vessel(tmp_path):
    floor = {"name": "floor", "material": "g", "plane": {"point": [0, 0, -0.1], "normal": [0, 0, 1]}}
    assert beside_a_box(tmp_path, [0, 0, 0]) == "", "inside"
    assert beside_a_box(tmp_path, [0, 0, 0.03]) == "", "they fall on it"
    assert beside_a_box(tmp_path, [0.06, 0, 0], moving={"velocities": [[-1, 0, 0], [0, 0, 0]]}, gravity=[0, 0, 0]) == ""
    assert beside_a_box(tmp_path, [0.06, 0, 0], [floor]) == "", "a body in a bed"
    periodic = {"x": {"kind": "periodic", "min": -0.1, "max": 0.1}}
    assert beside_a_box(tmp_path, [0.06, 0, 0], borders=periodic) == ""


def test_rates_are_told_in_both_units_before_a_run(tmp_path, monkeypatch):
    """A number meant in the other unit is seen: by check, by programs, and in the first lines of a run."""
    mill = [{"axis": [0, 0, 1], "rate": 30.0}, {"axis": [0, 0, 1], "rate": "-30 rpm"}]
    floor = {"material": "g", "plane": {"point": [0, 0, 0], "normal": [0, 0, 1]}}
    walls = [{"name": name, "motion": {"axis": [0, 0, 1], "rate": 2.0}, **floor} for name in "abcd"]
    turning = scene(frame=mill, walls=walls, time={"end": 2 * STEP, "step": STEP, "max_speed": 0.1})
    data = check.describe(Simulation(turning, device="cpu", threads=1), probe=False)
    assert data["largest_rates"] == {
        "frame[0]": 30.0, "frame[1]": math.pi, **{f"walls[{k}].motion": 2.0 for k in range(4)}
    }  # fmt: skip
    line = (
        "turns: frame[0] at up to 30 rad/s = 286.5 rpm; frame[1] at up to 3.142 rad/s = 30 rpm; "
        "walls[0].motion, walls[1].motion and 2 others at up to 2 rad/s = 19.1 rpm\n"
    )
    checked, begun, still = io.StringIO(), io.StringIO(), io.StringIO()
    check.print_description(data, Console(file=checked, width=200))
    assert line in checked.getvalue()
    monkeypatch.setattr(Simulation, "load_kernels", Mock(side_effect=RuntimeError("far enough")))
    with pytest.raises(RuntimeError, match="far enough"):
        run_scene(turning, tmp_path, device="cpu", threads=1, console=Console(file=begun, width=200))
    assert line in begun.getvalue()
    check.print_description(check.describe(simulation(), probe=False), Console(file=still, width=200))
    assert "turns:" not in still.getvalue()


def test_overlaps_are_warned_of_from_a_tenth_of_the_radius_or_where_the_run_stops():
    fast = {"end": 0.01, "step": 1e-6, "max_speed": 0.8}
    assert 0.05 < simulation(time=fast).limits.overlap < 0.1
    assert said(time=fast) == ""
    text = said(time=fast, engine={"max_overlap": 0.05})
    assert "over engine.max_overlap = 0.05 the run stops itself" in text and "brings that to 5%" in text


def test_steps_are_warned_of_from_eight_tenths_of_the_limit_of_one_impact():
    limit = simulation(time={"end": 0.01, "step": 1e-6, "max_speed": 1.0}).limits.stable
    for share, warned in ((0.75, False), (0.85, True)):
        text = said(time={"end": 0.01, "step": share * limit, "max_speed": 1.0})
        assert ("of the stability limit" in text) is warned, text


UP = [0, 0, 1]
TUBE = {"cylinder": {"point": [0, 0, -0.05], "axis": UP, "radius": 0.02, "length": 0.1}}
FLOOR = {"plane": {"point": [0, 0, -0.05], "normal": UP}}
BOWL = {"cone": {"apex": [0, 0, -0.05], "axis": UP, "half_angle": 0.6, "end": 0.1}}
HOPPER = {"cone": {**BOWL["cone"], "start": 0.03}}
DRUM = {"cylinder": {"point": [-0.02, 0, 0], "axis": [1, 0, 0], "radius": 0.03, "length": 0.04}}
SIDES = [{"plane": {"point": [-0.02 * n, 0, 0], "normal": [n, 0, 0]}} for n in (1, -1)]
ENDLESS = {"cylinder": {"point": [0, 0, 0], "axis": UP, "radius": 0.03}}


@pytest.mark.parametrize(
    ("shapes", "open_below"),
    [
        ([HOPPER], True), ([HOPPER, TUBE], True), ([TUBE], True), (SIDES, True), ([DRUM, SIDES[0]], True), ([ENDLESS], True),
        ([{"cone": {"apex": [0, 0, 0.1], "axis": [0, 0, -1], "half_angle": 0.6}}], True),
        ([{"plane": {"point": [0, 0, 0.1], "normal": [0, 0, -1]}}], True),
        ([HOPPER, FLOOR], False), ([TUBE, FLOOR], False), ([BOWL], False), ([TUBE, BOWL], False), ([DRUM, *SIDES], False),
        ([{"cone": {"apex": [0, 0, -0.05], "axis": UP, "half_angle": 0.6}}], False),
        ([{"cylinder": {"point": [0, 0, 0], "axis": [1, 0, 0], "radius": 0.03}}], False),
        ([{"sphere": {"centre": [0, 0, 0], "radius": 0.03}}], False),
        ([{"plane": {"point": [0, 0, -0.05], "normal": [1, 0, 1]}}], False),
        ([{"cone": {**BOWL["cone"], "start": 1e-3}}], False),  # a mouth narrower than a grain
    ],
)  # fmt: skip
def test_analytic_walls_with_a_way_out_are_warned_of(shapes, open_below):
    walls = [{"name": f"wall{k}", "material": "g", **shape} for k, shape in enumerate(shapes)]
    text = said(walls=walls)
    assert ("leave an opening below" in text) is open_below, text
    if open_below:
        assert "'wall0'" in text and "[borders] or [[outlets]]" in text
        below = {"name": "below", "box": {"min": [-1, -1, -2], "max": [1, 1, -1]}}
        assert "way out" not in said(walls=walls, outlets=[below])
        assert "way out" not in said(walls=walls, borders={"z": {"min": -1, "kind": "open"}})


def test_open_mesh_without_borders_is_a_warning(tmp_path):
    box = trimesh.creation.box((0.02, 0.02, 0.02))
    box.update_faces(box.face_normals[:, 2] < 0.5)
    box.export(tmp_path / "cup.stl")
    cup = [{"name": "cup", "material": "g", "mesh": str(tmp_path / "cup.stl"), "open": True}]
    text = said(walls=cup)
    for word in ("walls[0].mesh", "open along 0.08 m (4 edges)", "[borders] or [[outlets]]"):
        assert word in text, text
    below = {"name": "below", "box": {"min": [-1, -1, -2], "max": [1, 1, -1]}}
    assert "open along" not in said(walls=cup, outlets=[below])


def test_field_without_a_rate_is_a_warning(tmp_path):
    (tmp_path / "pull.py").write_text("PARAMETERS = {}\n\ndef build():\n    return None\n")
    parts = scene(fields=[{"model": str(tmp_path / "pull.py")}])
    sim = simulation()
    sim.scene = parts
    assert any("states no rate(mass, p)" in text for text in scene_warnings.warnings(sim))


def arrays_of(root) -> int:
    """Bytes of all device arrays that hang on a simulation; views count once."""
    spans, seen, stack = [], set(), [root]
    while stack:
        here = stack.pop()
        if id(here) in seen:
            continue
        seen.add(id(here))
        if isinstance(here, wp.array):
            if here.ptr:
                spans.append((here.ptr, here.ptr + here.size * wp.types.type_size_in_bytes(here.dtype)))
        elif isinstance(here, dict):
            stack += here.values()
        elif isinstance(here, (list, tuple)):
            stack += here
        elif type(here).__module__.startswith("warpdem") or "Struct" in type(here).__name__:
            stack += vars(here).values()
    total = end = 0
    for first, last in sorted(spans):
        total += max(0, last - max(first, end))
        end = max(end, last)
    return total


@pytest.fixture(scope="module")
def bed():
    """343 grains pressed together: a settled bed in small."""
    at = [[2e-3 * 0.99 * x, 2e-3 * 0.99 * y, 1e-3 + 2e-3 * 0.99 * z] for x in range(7) for y in range(7) for z in range(7)]
    grains = [{"material": "g", "radius": 1e-3, "positions": at}]
    return scene(grains=grains, time={"end": 0.004, "step": STEP, "max_speed": 0.1})


def test_estimates_are_those_of_the_run(bed, tmp_path, monkeypatch):
    """Steps, frames and rows exactly; size of the results closely; memory as a settled bed needs it."""
    monkeypatch.setattr(check, "PROBE_SECONDS", 0.05)
    data = check.describe(Simulation(bed, device="cpu", threads=1))
    run_scene(bed, tmp_path, device="cpu", threads=1, quiet=True)
    frames = list(tmp_path.glob("**/grains_*.vtp"))
    rows = (tmp_path / "history.csv").read_text().count("\n") - 1
    assert (data["frames"], data["rows"]) == (len(frames), rows)
    written = sum(path.stat().st_size for path in tmp_path.rglob("*") if path.suffix in (".vtp", ".usdc"))
    assert data["output_bytes"] == pytest.approx(written, rel=0.2)
    sim = Simulation(bed, device="cpu", threads=1)
    sim.step(20)
    # the table of what changes with time is long where grains are few, and of no grain
    assert 0.6 < data["memory_bytes"] / (arrays_of(sim) - arrays_of(sim.engine.batch.control)) < 1.7
    assert data["settled_seconds"] >= data["estimated_seconds"] >= data["seconds_per_step"] * data["steps"]


def test_what_is_said_is_json_and_text(bed):
    data = check.describe(Simulation(bed, device="cpu", threads=1), probe=False)
    assert "estimated_seconds" not in data
    assert json.loads(json.dumps(data, allow_nan=False)) == data
    longer = data["steps_per_contact"] * STEP / Simulation(bed, device="cpu", threads=1).limits.contact_time
    assert longer == pytest.approx(hertz.damped_time(0.5), rel=1e-12)
    text = io.StringIO()
    check.print_description(data, Console(file=text, width=200))
    for word in ("343 grains", "normal: hertz", "left out", "[s]", "Rayleigh time", "none", "steps per contact", "MB"):
        assert word in text.getvalue(), word


FED = {"material": "g", "box": {"min": [0, 0, 0.01], "max": [0.02, 0.02, 0.03]}, "diameter": 2e-3}


def test_grains_that_streams_bring_are_in_the_estimates(monkeypatch):
    """How many come at most, rate times time up to the end; memory, time and results with all of them, also from none on."""
    monkeypatch.setattr(check, "PROBE_SECONDS", 0.05)
    grain = 2500 * math.pi / 6 * 8e-9
    streams = [
        {**FED, "count_rate": 1e5, "start": 2e-3, "until": 8e-3},
        {**FED, "mass_rate": 2e4 * grain, "start": 5e-3},
        {**FED, "count_rate": 1e5, "start": 0.5},
    ]
    sims = [simulation(grains=[], streams=streams), simulation(streams=streams), simulation()]
    alone, both, without = (check.describe(sim) for sim in sims)
    each = sims[0].plan.bytes_per_grain
    for data, grains in ((alone, 0), (both, 2)):
        assert [stream["grains"] for stream in data["streams"]] == [600, 100, 0]
        assert data["grains"] == grains and data["grains_at_most"] == grains + 700
        assert data["memory_bytes"] == each * (grains + 700)
        assert data["frames"] == 6
        # in the mean over the run 600 (1 - 5/10) and 100 (1 - 7.5/10) of them are there, in two formats
        assert data["output_bytes"] > 0.5 * 6 * 2 * 100 * (300 + 25)
        assert data["output_bytes"] > without["output_bytes"]
        assert data["settled_seconds"] > data["estimated_seconds"] > data["start_seconds"]
    assert without["streams"] == [] and without["grains_at_most"] == 2
    out = io.StringIO()
    check.print_description(alone, Console(file=out, width=200))
    assert "0 grains on cpu" in out.getvalue()
    each = "streams[0] 600, streams[1] 100, streams[2] 0"
    assert f"at most 700 grains by the end, if there is space for all ({each})" in out.getvalue()
    json.dumps(alone, allow_nan=False)


def test_streams_beyond_the_memory_are_told_but_not_refused(monkeypatch):
    """They may find no room, or leave again."""
    told = said(grains=[], streams=[{**FED, "count_rate": 1e15}])
    assert "with the 10000000000000 that streams bring by time.end if all find room" in told and "available" in told


def test_what_warnings_tell_to_take_is_accepted():
    """The step, the skin: with the number of the warning there is none any more."""
    for changes in ({"time": {"end": 0.01, "step": 2e-5, "max_speed": 1.0}}, {"frame": {"axis": [0, 0, 1], "rate": 1e4}}):
        for _ in range(4):
            steps = [text for text in scene_warnings.warnings(simulation(**changes)) if "time.step of at most" in text]
            if not steps:
                break
            step = float(steps[0].split("at most ")[-1].split(" s")[0])
            changes["time"] = {**changes.get("time", {"end": 0.01, "max_speed": 0.1}), "step": step}
        assert not steps
    fast = {"time": {"end": 0.01, "step": 2e-5, "max_speed": 2.0}}  # crosses half of the skin that a run begins with in 5 steps
    assert simulation(**fast).lists.skin == pytest.approx(4e-4, rel=1e-9)
    assert not [text for text in scene_warnings.warnings(simulation(**fast)) if "engine.skin" in text]  # a run widens it
    fast["time"]["max_speed"] = 10.0
    assert [text for text in scene_warnings.warnings(simulation(**fast)) if "half the skin of the lists (0.002 m)" in text]
    changes = {"engine": {"skin": 1e-6}}
    [skin] = [text for text in scene_warnings.warnings(simulation(**changes)) if "engine.skin" in text]
    changes["engine"]["skin"] = float(skin.split("engine.skin = ")[1].split(" m")[0])
    assert not [text for text in scene_warnings.warnings(simulation(**changes)) if "engine.skin" in text]


def test_table_of_limits_fits_a_terminal_and_what_is_left_out_comes_after():
    data = check.describe(simulation(), probe=False)
    out = io.StringIO()
    check.print_description(data, Console(file=out, width=80))
    lines = [line.rstrip() for line in out.getvalue().splitlines()]
    for row in data["limits"]:
        [line] = [line for line in lines if row["name"] in line]
        assert line.startswith(f"  {row['name']}{' *' if row['refused'] else '  '}")
        assert line.endswith("-" if row["auto_share"] is None else f" {row['auto_share']:g}")
    assert [row["key"] for row in data["limits"] if row["refused"]] == ["impact", "travel"]
    assert "  * a longer step is refused" in lines
    told = " ".join(lines).split("left out: ")
    assert len(told) == 2 and "time step" in told[0] and "left out" not in told[0]
    assert "turning of the axes: no frame; " in told[1]


def test_the_step_of_auto_knows_the_fields():
    """The least is 0.1 of the fastest field's own time, when that is the least."""
    mass = 2500 * 4 / 3 * math.pi * 1e-9
    for field, rate in zip(FIELDS, (math.sqrt(2.0 / mass), 1e-4 / mass, 5e-3 / mass), strict=True):
        sim = simulation(fields=[field], time={"end": 0.01, "max_speed": 1e-3})
        assert sim.limits.field == pytest.approx(0.1 / rate, rel=1e-12)
        assert sim.dt == min(sim.limits.candidates.values()) <= 0.1 / rate
    stiff = simulation(fields=[{"model": "drag", "parameters": {"coefficient": 5.0}}], time={"end": 0.01, "max_speed": 1e-3})
    assert stiff.dt == pytest.approx(0.1 * mass / 5.0, rel=1e-12)
    assert "external fields" in stiff.limits.binding


def test_a_law_that_is_named_and_has_no_coefficients_is_told_once():
    pairs = [{"materials": ["g", "g"], "restitution": 0.5}]
    rolling = {"tangential": "mindlin", "rolling": "constant"}
    [line] = scene_warnings.warnings(simulation(contact=rolling, pairs=pairs))
    assert 'contact.tangential = "mindlin" and contact.rolling = "constant": without effect' in line
    assert "friction and rolling_friction are 0" in line
    [line] = scene_warnings.warnings(simulation(contact=rolling, pairs=[{**pairs[0], "friction": 0.3}]))
    assert "rolling" in line and "mindlin" not in line
    assert said(contact=rolling, pairs=[{**pairs[0], "friction": 0.3, "rolling_friction": 0.1}]) == ""
    assert said(contact={}, pairs=pairs) == ""  # not named: the default


def test_a_pressure_that_pulls_is_warned_of():
    lid = {"name": "lid", "material": "g", "plane": {"point": [0, 0, 0.01], "normal": [0, 0, -1]}}
    for pressure in (-500, [[0, 0], [0.1, -500]]):
        servo = {"axis": [0, 0, -1], "pressure": pressure, "area": 1e-4, "max_speed": 0.01}
        assert "walls[0].servo.pressure = -500 Pa: the wall pulls" in said(walls=[lid | {"servo": servo}])
    assert "pulls" not in said(walls=[lid | {"servo": servo | {"pressure": 500}}])


def test_a_pressure_in_another_unit_is_told_as_a_pressure():
    servo = {"axis": [0, 0, -1], "pressure": "500 N", "area": 1e-4, "max_speed": 0.01}
    lid = {"name": "lid", "material": "g", "plane": {"point": [0, 0, 0.01], "normal": [0, 0, -1]}, "servo": servo}
    with pytest.raises(SceneError, match=r'(?s)servo\.pressure.*must be a pressure.*"N" is not a pressure'):
        scene(walls=[lid])
