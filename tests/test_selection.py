"""Measures of some grains only: by group, material and diameter; profiles, and the fabric of contacts."""

import numpy as np
import pytest

from warpdem import Scene, SceneError, Simulation
from warpdem.measure.contact_network import read_network
from warpdem.scene.file import scene_from_dict

SMALL, LARGE = 1e-3, 2e-3
MASS = 4 / 3 * np.pi * 2500.0


def data(measures, **more):
    """Four grains apart: two groups, two materials, two sizes; without gravity."""
    def entry(name, material, radius, x, speed):
        return {"name": name, "material": material, "radius": radius, "positions": [[x, 0, 0]], "velocities": [[speed, 0, 0]]}

    return {
        "gravity": [0, 0, 0],
        "materials": {name: {"density": 2500.0, "young_modulus": 5e6, "poisson_ratio": 0.25} for name in "gh"},
        "contact": {"tangential": "none"},
        "pairs": [{"materials": list(pair), "restitution": 0.5} for pair in ("gg", "gh", "hh")],
        "grains": [
            entry("red", "g", SMALL, 0.00, 1.0), entry("blue", "g", LARGE, 0.01, 2.0),
            entry("red", "h", LARGE, 0.02, 4.0), entry("blue", "h", SMALL, 0.03, -1.0),
        ],
        "time": {"end": 0.05, "step": 1e-5, "max_speed": 1e-3},
        "measures": measures,
        **more,
    }  # fmt: skip


def simulated(measures, **more):
    return Simulation(Scene.model_validate(data(measures, **more)), device="cpu", threads=1)


SELECTIONS = [
    ({"group": "red"}, [0, 2]),
    ({"material": "h"}, [2, 3]),
    ({"diameter": [0, 2 * LARGE]}, [0, 3]),
    ({"diameter": ["4 mm", "5 mm"]}, [1, 2]),
    ({"group": "blue", "material": "g"}, [1]),
    ({"group": "red", "material": "g", "diameter": [3e-3, 5e-3]}, []),
]


@pytest.mark.parametrize(("of", "ids"), SELECTIONS)
def test_a_region_counts_the_grains_of_its_selection(of, ids):
    box = {"min": [-0.01, -0.01, -0.01], "max": [0.04, 0.01, 0.01]}
    found = simulated({"regions": [{"name": "some", "of": of, "box": box}]}).measure()
    radius = np.array([SMALL, LARGE, LARGE, SMALL])[ids]
    x, speed = np.array([0, 0.01, 0.02, 0.03])[ids], np.array([1.0, 2, 4, -1])[ids]
    mass = MASS * radius**3
    assert found["region some grains [-]"] == len(ids)
    assert found["region some mass [kg]"] == pytest.approx(mass.sum())
    assert found["region some solid_fraction [-]"] == pytest.approx(mass.sum() / 2500 / (0.05 * 0.02 * 0.02))
    if ids:
        mean = [mass @ values / mass.sum() for values in (speed, np.abs(speed), x)]
        names = ("velocity_x [m/s]", "speed [m/s]", "centre_x [m]")
        assert [found[f"region some {name}"] for name in names] == pytest.approx(mean)
    assert not any("stress" in name for name in found)


def test_flow_counts_the_grains_of_a_selection_also_when_they_have_left():
    """Each alone on its lane at 1 m/s; they pass at 10, 20 and 30 ms and leave 15 ms later."""
    planes = [{"name": name, "point": [0, 0, 0], "normal": [1, 0, 0], **of} for name, of in
              (("all", {}), ("red", {"of": {"group": "red"}}), ("small", {"of": {"diameter": [0, 2 * LARGE]}}))]  # fmt: skip
    outlet = {"name": "end", "box": {"min": [0.015, -1, -1], "max": [1, 1, 1]}}
    kinds = [("red", SMALL), ("blue", LARGE), ("red", LARGE)]
    grains = [{"name": name, "material": "g", "radius": radius, "positions": [[-0.01 * (k + 1), 0.01 * k, 0]],
               "velocities": [[1, 0, 0]]} for k, (name, radius) in enumerate(kinds)]  # fmt: skip
    sim = simulated({"flow": planes}, outlets=[outlet], grains=grains)
    seen = []
    for until in (0.012, 0.022, 0.05):
        sim.run(until)
        found = sim.measure()
        seen.append([found[f"flow {name} count [-]"] for name in ("all", "red", "small")])
    assert seen == [[1, 1, 1], [2, 1, 1], [3, 2, 1]]
    assert sim.left["end"][0] == 3
    assert found["flow red mass [kg]"] == pytest.approx(MASS * (SMALL**3 + LARGE**3))


def test_mixing_of_a_selection_against_the_rest():
    places = np.random.default_rng(2).uniform(0, 1, (400, 3))
    half = places[:, 0] < 0.5
    grains = [{"name": name, "material": "g", "radius": 1e-3, "positions": (places[which]).tolist()}
              for name, which in (("a", half), ("b", ~half))]  # fmt: skip
    asked = [{"name": "sides", "first": {"group": "b"}, "cell": 0.5}, {"name": "same", "by": "group", "cell": 0.5}]
    found = simulated({"mixing": asked}, grains=grains).measure()
    assert found["mixing sides [-]"] == pytest.approx(0.0, abs=1e-12)
    assert found["mixing same [-]"] == pytest.approx(0.0, abs=1e-12)


def test_the_slices_of_a_profile_are_regions_side_by_side():
    box = {"min": [-0.005, -0.01, -0.01], "max": [0.035, 0.01, 0.01]}
    asked = {"profiles": [{"name": "p", "box": box, "along": "x", "slices": 4}], "regions": [{"name": "whole", "box": box}]}
    found = simulated(asked).measure()
    columns = [f"region p_{k} " for k in range(4)]
    assert [found[f"{name}grains [-]"] for name in columns] == [1] * 4
    assert [found[f"{name}velocity_x [m/s]"] for name in columns] == pytest.approx([1, 2, 4, -1])
    solid = sum(found[f"{name}solid_fraction [-]"] for name in columns) / 4
    assert solid == pytest.approx(found["region whole solid_fraction [-]"], rel=1e-12)
    assert f"{columns[0]}stress_zz [Pa]" in found
    assert not any("fabric" in name for name in found)


def test_fabric_of_a_chain_and_of_a_cross():
    """Contacts along x only: Phi_xx = 1. A grain with a neighbor on each axis, and one beside it: by hand."""
    gap, grains = 1.99e-3, [{"material": "g", "radius": 1e-3, "positions": [[1.99e-3 * k, 0, 0] for k in range(4)]}]
    names = [f"region r fabric_{pair} [-]" for pair in ("xx", "yy", "zz", "xy", "yz", "zx")]
    asked = {"regions": [{"name": "r", "fabric": True}]}
    found = simulated(asked, grains=grains).measure()
    assert [found[name] for name in names] == pytest.approx([1, 0, 0, 0, 0, 0], abs=1e-12)
    slant = gap * np.array([0.6, 0.0, 0.8])
    places = [[0, 0, 0], [0, gap, 0], slant.tolist()]
    asked = {"regions": [{"name": "r", "fabric": True, "of": {"group": "middle"}}]}
    grains = [{"name": name, "material": "g", "radius": 1e-3, "positions": at}
              for name, at in (("middle", places[:1]), ("round", places[1:]))]  # fmt: skip
    sim = simulated(asked, grains=grains)
    assert len(read_network(sim.view).i) == 2
    found = sim.measure()
    assert [found[name] for name in names] == pytest.approx([0.18, 0.5, 0.32, 0, 0, 0.24], abs=1e-12)


BAD = [
    ({"regions": [{"name": "r", "of": {}}]}, r"regions\[0\]\.of.*at least one of group, material, diameter"),
    ({"regions": [{"name": "r", "of": {"group": "green"}}]}, r"regions\[0\]\.of\.group.*green.*red, blue"),
    ({"flow": [{"name": "f", "point": [0, 0, 0], "normal": [1, 0, 0], "of": {"material": "i"}}]},
     r"flow\[0\]\.of\.material.*no such material; the scene has g, h"),
    ({"regions": [{"name": "r", "of": {"diameter": [2e-3, 1e-3]}}]}, r"of\.diameter.*smallest < largest"),
    ({"mixing": [{"name": "m", "cell": 0.1}]}, r"mixing\[0\].*exactly one of by, first"),
    ({"mixing": [{"name": "m", "cell": 0.1, "first": {"group": "no"}}]}, r"mixing\[0\]\.first\.group"),
    ({"profiles": [{"name": "p", "box": {"min": [0, 0, 0], "max": [1, 1, 1]}, "along": "x", "slices": 0}]}, r"slices"),
    ({"profiles": [{"name": "p", "box": {"min": [0, 0, 0], "max": [1, 1, 1]}, "along": "x", "slices": 2}],
      "regions": [{"name": "p_1"}]}, r"profiles\[0\]\.name.*p_1.*names must differ"),
]  # fmt: skip


@pytest.mark.parametrize(("measures", "message"), BAD)
def test_selections_that_select_nothing_there_is_are_refused(measures, message):
    with pytest.raises(SceneError, match=f"(?s){message}"):
        scene_from_dict(data(measures), source="bad.toml")


def test_a_group_of_the_run_before_is_known_to_the_scene_that_starts_from_it(tmp_path):
    sim = simulated({})
    sim.save_checkpoint(tmp_path / "a.h5")
    more = {"grains": [], "start": {"checkpoint": str(tmp_path / "a.h5")}}
    known = scene_from_dict({**data({"regions": [{"name": "r", "of": {"group": "red"}}]}), **more})
    assert Simulation(known, device="cpu", threads=1).measure()["region r grains [-]"] == 2
    unknown = scene_from_dict({**data({"regions": [{"name": "r", "of": {"group": "green"}}]}), **more})
    with pytest.raises(SceneError, match=r"(?s)measures\.regions\[0\]\.of\.group.*green.*red, blue"):
        Simulation(unknown, device="cpu", threads=1)
