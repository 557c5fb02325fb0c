"""Checkpoints: what is saved comes back, damage is seen before anything changes, a resumed run goes on bit for bit."""

import h5py
import numpy as np
import pytest
import trimesh

from warpdem import Scene, SceneError, Simulation, checkpoint

RADIUS = 1.0e-3


@pytest.fixture(scope="module")
def box(tmp_path_factory):
    path = tmp_path_factory.mktemp("checkpoint") / "box.stl"
    trimesh.creation.box((10e-3, 10e-3, 12e-3)).export(path)
    return path


def scene(box, friction: float = 0.5, rolling: str = "spring") -> Scene:
    """A small heap in a turning box: 48 grains in contact, springs stretched."""
    rng = np.random.default_rng(4)
    cell = np.stack(np.meshgrid(*[np.arange(k) for k in (4, 4, 3)], indexing="ij"), axis=-1).reshape(-1, 3)
    n = len(cell)
    return Scene.model_validate(
        {
            "gravity": [0, 0, -60],
            "materials": {"glass": {"density": 2500, "young_modulus": 4e6, "poisson_ratio": 0.3}},
            "contact": {"rolling": rolling},
            "pairs": [
                {"materials": ["glass", "glass"], "restitution": 0.6, "friction": friction, "rolling_friction": 0.2}
            ],
            "grains": [
                {
                    "material": "glass",
                    "positions": (cell - [1.5, 1.5, 1.0]) * 2.1e-3 - [0, 0, 2e-3],
                    "radius": RADIUS,
                    "velocities": rng.normal(0.0, 0.1, (n, 3)),
                    "ids": rng.permutation(n) + 100,
                }
            ],
            "walls": [{"name": "box", "material": "glass", "mesh": str(box)}],
            "frame": {"axis": [0, 1, 0], "schedule": [{"until": 0.01, "rate": [0, 30]}, {"rate": 30}]},
            "time": {"end": 1, "step": 2e-5, "max_speed": 1},
            "engine": {"max_overlap": 0.3},
        }
    )


@pytest.fixture(scope="module", params=["constant", "spring"])
def run(request, box):
    """A run in its middle."""
    sim = Simulation(scene(box, rolling=request.param), device="cpu", threads=1)
    sim.step(801)
    assert len(sim.contacts().i) > 50
    return sim


@pytest.fixture
def saved(run, tmp_path):
    run.save_checkpoint(tmp_path / "saved.h5")
    return tmp_path / "saved.h5"


def readings(sim) -> dict[str, np.ndarray]:
    """All that can be read, in an order that does not depend on the lists."""
    p, c = sim.particles, sim.contacts()
    order = np.lexsort((*c.point.T, c.j, c.i))
    names = ("i", "j", "overlap", "normal", "force", "spring", "point", "share", "stiffness")
    return {
        **{name: getattr(p, name) for name in ("id", "radius", "mass", "position", "velocity", "spin", "position_lab")},
        "loads": np.array(sim.loads()),
        "energy": np.array(list(sim.energy().values())),
        **{f"contact {name}": getattr(c, name)[order] for name in names},
    }


def assert_equal_readings(first, second):
    found = readings(second)
    for name, values in readings(first).items():
        # an energy is a sum in the order of the lists, which are made anew: its last bit may change
        tolerance = 1e-14 if name == "energy" else 0.0
        np.testing.assert_allclose(found[name], values, rtol=tolerance, atol=0, err_msg=name)


def test_round_trip_gives_every_reading_back(run, saved):
    again = Simulation.from_checkpoint(saved, device="cpu", threads=1)
    assert (again.step_number, again.time, again.dt) == (run.step_number, run.time, run.dt)
    assert again.state_hash() == run.state_hash()
    assert again.extremes == run.extremes
    assert_equal_readings(run, again)


def test_checkpoint_of_a_resumed_run_is_the_same_checkpoint(run, saved, tmp_path):
    """Saved again before any step: nothing may be lost on the way."""
    again = Simulation.from_checkpoint(saved, device="cpu", threads=2)
    again.save_checkpoint(tmp_path / "again.h5")
    first, second = checkpoint.read(saved), checkpoint.read(tmp_path / "again.h5")
    assert first.keys() == second.keys()
    third = Simulation.from_checkpoint(tmp_path / "again.h5", device="cpu", threads=1)
    third.step(150)
    straight = Simulation.from_checkpoint(saved, device="cpu", threads=1)
    straight.step(150)
    assert third.state_hash() == straight.state_hash()


@pytest.mark.parametrize("threads", [1, 2])
def test_resumed_run_equals_the_uninterrupted_one(box, tmp_path, threads, run):
    rolling = run.plan.rolling
    whole = Simulation(scene(box, rolling=rolling), device="cpu", threads=1)
    whole.step(300)
    for cut in (1, 149, 150):
        first = Simulation(scene(box, rolling=rolling), device="cpu", threads=3 - threads)
        first.step(cut)
        first.save_checkpoint(tmp_path / "cut.h5")
        second = Simulation.from_checkpoint(tmp_path / "cut.h5", device="cpu", threads=threads)
        second.step(300 - cut)
        assert second.state_hash() == whole.state_hash(), f"cut at {cut}"
        assert_equal_readings(whole, second)


def test_history_is_in_the_checkpoint(run, saved, tmp_path):
    """Without the springs the run goes on otherwise: the test of equality above can see them."""
    with h5py.File(saved, "r+") as file:
        assert len(file["pair_memory"]) > 20
        file["pair_memory"][...] = 0.0
    straight, bare = run, Simulation.from_checkpoint(saved, device="cpu", threads=1)
    run.save_checkpoint(tmp_path / "kept.h5")
    kept = Simulation.from_checkpoint(tmp_path / "kept.h5", device="cpu", threads=1)
    for sim in (kept, bare):
        sim.step(20)
    assert kept.state_hash() != bare.state_hash()
    assert straight.step_number == 801


def damaged(kind: str, path) -> None:
    data = path.read_bytes()
    match kind:
        case "missing":
            path.unlink()
        case "empty":
            path.write_bytes(b"")
        case "truncated":
            path.write_bytes(data[: len(data) // 2])
        case "foreign":
            path.write_text("this is no checkpoint")
        case "other HDF5":
            with h5py.File(path, "w") as file:
                file["x"] = [1.0]
        case "other version":
            with h5py.File(path, "r+") as file:
                file.attrs["format"] = "warpdem checkpoint 0"
        case "array gone":
            with h5py.File(path, "r+") as file:
                del file["record"]
        case "array short":
            with h5py.File(path, "r+") as file:
                short = file["record"][:-1]
                del file["record"]
                file["record"] = short
        case "not finite":
            with h5py.File(path, "r+") as file:
                file["record"][3, 0] = np.nan


KINDS = (
    "missing", "empty", "truncated", "foreign", "other HDF5", "other version", "array gone", "array short", "not finite",
)  # fmt: skip


@pytest.mark.parametrize("kind", KINDS)
def test_damaged_file_is_refused_and_nothing_changes(box, run, saved, kind):
    damaged(kind, saved)
    with pytest.raises(SceneError, match=r"saved\.h5"):
        Simulation.from_checkpoint(saved, device="cpu", threads=1)
    if kind in ("missing", "truncated", "array gone", "array short", "not finite"):
        sim = Simulation(scene(box, rolling=run.plan.rolling), device="cpu", threads=1)
        sim.step(7)
        before = sim.state_hash()
        with pytest.raises(SceneError):
            checkpoint.restore(sim, saved)
        assert (sim.step_number, sim.state_hash()) == (7, before)
        sim.step(1)


def test_checkpoint_of_another_scene_is_refused(box, run, saved):
    sim = Simulation(scene(box, friction=0.4, rolling=run.plan.rolling), device="cpu", threads=1)
    before = sim.state_hash()
    with pytest.raises(SceneError, match="another scene"):
        checkpoint.restore(sim, saved)
    assert sim.state_hash() == before


def test_saving_replaces_the_old_file_at_once(run, saved, tmp_path):
    run.save_checkpoint(saved)
    assert [path.name for path in tmp_path.iterdir()] == ["saved.h5"]
    with pytest.raises(SceneError, match="cannot be written"):
        run.save_checkpoint(tmp_path / "no" / "such" / "folder.h5")
