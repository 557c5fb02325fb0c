"""Copies of a bed that is there: where they are, across periodic seams, and files that are none."""

import json

import h5py
import numpy as np
import pytest

from warpdem import Scene, SceneError, Simulation

RADIUS, PERIOD = 1e-3, 6e-3


def scene(base, grains, borders=True, **more):
    data = {
        "base": base,
        "materials": {"g": {"density": 2500, "young_modulus": 1e7, "poisson_ratio": 0.3}},
        "contact": {"tangential": "none"},
        "pairs": [{"materials": ["g", "g"], "restitution": 0.5}],
        "grains": [{"material": "g", **grains}],
        "time": {"end": 0.01, "step": 1e-5, "max_speed": 0.1},
        "engine": {"skin": 4e-4},
    }
    data |= {"borders": {"x": {"min": 0, "max": PERIOD, "kind": "periodic"}}} if borders else {}
    return Scene.model_validate(data | more)


@pytest.fixture(scope="module")
def bed(tmp_path_factory):
    """Folder with the checkpoint of three grains of two sizes, of which two meet through the border across x."""
    folder = tmp_path_factory.mktemp("tile")
    grains = {
        "positions": [[0.9e-3, 0, 0], [PERIOD - 0.9e-3, 0, 0], [3e-3, 2e-3, 1e-3]], "radii": [RADIUS, RADIUS, 0.5 * RADIUS],
        "velocities": [[0, 0, 1e-3]] * 3, "ids": [7, 3, 5],
    }  # fmt: skip
    sim = Simulation(scene(folder, grains, engine={"skin": 4e-4, "max_overlap": 0.3}), device="cpu", threads=1)
    sim.save_checkpoint(folder / "bed.h5")
    np.savez(folder / "bed.npz", x=sim.particles.position, r=sim.particles.radius)
    return folder


@pytest.mark.parametrize(
    ("name", "given", "spacing"),
    [
        ("bed.h5", {}, [PERIOD, 3.5e-3, 2.5e-3]),
        ("bed.npz", {}, [PERIOD + 0.2e-3, 3.5e-3, 2.5e-3]),
        ("bed.h5", {"spacing": ["7 mm", "4 mm", "3 mm"]}, [7e-3, 4e-3, 3e-3]),
    ],
)
def test_copies_stand_side_by_side(bed, name, given, spacing):
    """At the period of the tile, else by its length with its grains, else as asked; at rest, with ids of their own."""
    copies = {"tile": name, "copies": [2, 1, 3], **given}
    tile = {"fill": {"tile": name}}
    one, many = (
        Simulation(scene(bed, grains, borders=False, engine={"max_overlap": 0.3}), device="cpu", threads=1).particles
        for grains in (tile, {"fill": copies})
    )
    shifts = np.array([[i, 0, k] for i in range(2) for k in range(3)]) * spacing
    np.testing.assert_allclose(many.position, np.concatenate([one.position + shift for shift in shifts]), atol=1e-12, rtol=0)
    np.testing.assert_array_equal(many.radius, np.tile(one.radius, 6))
    np.testing.assert_array_equal(many.id, np.arange(18))
    assert not many.velocity.any()


def test_grains_meet_across_the_seam_as_they_did_across_the_border(bed):
    near = Simulation(scene(bed, {"fill": {"tile": "bed.h5", "copies": [2, 1, 1]}}, borders=False,
                            engine={"max_overlap": 0.3}), device="cpu", threads=1)  # fmt: skip
    assert len(near.contacts().j) == 1
    np.testing.assert_allclose(near.contacts().overlap, 0.2e-3, rtol=1e-6, atol=0)


def broken(text: str):
    """A change of a checkpoint."""

    def change(path):
        with h5py.File(path, "r+") as file:
            if text == "no grains":
                shape = file["record"].shape
                del file["record"]
                file["record"] = np.zeros((0, shape[1]))
            elif text == "nan":
                file["record"][1, 0] = np.nan
            elif text == "no record":
                del file["record"]
            elif text == "clumps":
                file["clump_of_grain"] = np.array([-1, 0, 0])
            else:
                file.attrs["format"] = "another"

    return change


@pytest.mark.parametrize(
    ("text", "said"),
    [("no grains", "holds no grains"), ("nan", "no number that a grain can have"), ("no record", "damaged"),
     ("clumps", "holds clumps"), ("format", "not a checkpoint")],
)  # fmt: skip
def test_files_that_are_no_tile_are_refused(bed, tmp_path, text, said):
    (tmp_path / "bed.h5").write_bytes((bed / "bed.h5").read_bytes())
    broken(text)(tmp_path / "bed.h5")
    with pytest.raises(SceneError, match=said) as error:
        Simulation(scene(tmp_path, {"fill": {"tile": "bed.h5"}}), device="cpu", threads=1)
    assert "grains[0].fill.tile" in str(error.value)


def test_more_copies_than_memory_holds_are_refused(bed):
    with pytest.raises(SceneError, match=r"fill.copies: .* of memory, .* take fewer copies"):
        Simulation(scene(bed, {"fill": {"tile": "bed.h5", "copies": [100_000, 100_000, 100_000]}}), device="cpu")


def test_the_tile_is_a_file_of_the_scene(bed):
    """Its content counts for whether a checkpoint belongs to a scene."""
    sim = Simulation(scene(bed, {"fill": {"tile": "bed.h5"}}, engine={"max_overlap": 0.3}), device="cpu", threads=1)
    assert "grains[0].fill.tile" in sim.model.given.files
    assert json.loads(sim.model.given.json)["grains"][0]["fill"]["copies"] == [1, 1, 1]
