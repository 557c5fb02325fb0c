"""What run.json says of the coefficients that laws read, of clumps and of streams; *against* the scene."""

import numpy as np

import twelve_grains
from warpdem import Simulation
from warpdem.app.run_record import record
from warpdem.scene import pair_keys

PAIR = {"materials": ["glass", "glass"], "restitution": 0.6}


def read(contact, **coefficients):
    scene = twelve_grains.scene(contact=contact, pairs=[PAIR | coefficients])
    return pair_keys.read_by(scene.contact, scene.pairs, scene.located)


def test_coefficients_are_those_that_the_laws_read():
    assert read({"tangential": "none"}) == {"restitution": "-"}
    assert read({}) == {"restitution": "-", "friction": "-"}
    assert read({"rolling": "constant"}) == {"restitution": "-", "friction": "-", "rolling_friction": "-"}
    assert read({"rolling": "spring"})["rolling_damping"] == "-"
    assert read({"normal": "hooke", "tangential": "none"}, stiffness=1e3) == {
        "restitution": "-", "stiffness": "N/m", "tangential_stiffness_ratio": "-"
    }  # fmt: skip
    assert set(read({"normal": "dmt", "tangential": "none"}, surface_energy=0.1)) == {
        "restitution", "surface_energy", "tail_length"
    }  # fmt: skip


def test_a_law_of_the_user_reads_its_own_keys_and_those_of_the_package_that_are_given(tmp_path):
    law = tmp_path / "soft.py"
    law.write_text(
        "from warpdem.kernels.normal.hooke import *\n"
        "from warpdem.kernels.normal import hooke\n"
        'PAIR = {"softness": ("Pa", 2.0, "Softness [Pa].")}\n'
    )
    scene = twelve_grains.scene(contact={"normal": str(law), "tangential": "none"}, pairs=[PAIR | {"stiffness": 1e3}])
    assert pair_keys.read_by(scene.contact, scene.pairs, scene.located) == {
        "restitution": "-", "softness": "Pa", "stiffness": "N/m"
    }  # fmt: skip


def recorded(scene):
    return record(Simulation(scene, device="cpu", threads=1), "done", 0.0, None)


def test_clumps_are_counted():
    """Of two spheres that do not overlap, the sphere of equal mass is 2^(1/3) times as large."""
    pair = [{"centre": [0, 0, 0], "radius": 1e-3}, {"centre": [0, 0, 2e-3], "radius": 1e-3}]
    found = recorded(twelve_grains.scene(
        clumps={"pair": {"spheres": pair}}, contact={}, pairs=[PAIR | {"friction": 0.5}],
        output={"interval": 2e-3, "formats": ["vtk"], "picture": False},
        grains=[{"material": "glass", "radius": 1e-3, "positions": [[0, 0, 2e-2]]},
                {"material": "glass", "clump": "pair", "positions": [[0, 0, 5e-3], [0, 0, 1e-2]]}],
    ))  # fmt: skip
    of = found["clumps"]["pair"]
    assert list(found["clumps"]) == ["pair"] and (of["count"], of["members"]) == (2, 2)
    np.testing.assert_allclose(list(of["equivalent_diameter"].values()), 2e-3 * 2.0 ** (1 / 3), rtol=1e-9)
    assert found["pair_keys"] == {"restitution": "-", "friction": "-"}


def test_streams_have_their_names():
    box = {"min": [-0.05, -0.05, 0.05], "max": [0.05, 0.05, 0.06]}
    stream = {"material": "glass", "diameter": 2e-3, "count_rate": 10.0, "box": box}
    found = recorded(twelve_grains.scene(streams=[stream | {"name": "feed"}, stream]))
    assert [way["name"] for way in found["came"]] == ["feed", None] and found["clumps"] == {}
