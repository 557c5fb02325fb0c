"""Checkpoints: what is saved comes back, damage is seen before anything changes, a resumed run goes on bit for bit."""

import tracemalloc
from pathlib import Path

import h5py
import numpy as np
import pytest
import trimesh

from warpdem import Scene, SceneError, Simulation
from warpdem.errors import OutputError
from warpdem.scene.file import load_scene
from warpdem.state import blocks, checkpoint, checkpoint_file, same_scene

HOURGLASS = Path(__file__).resolve().parent.parent / "scenes" / "hourglass.toml"

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
    first, second = checkpoint_file.read(saved), checkpoint_file.read(tmp_path / "again.h5")
    assert first.keys() == second.keys()
    third = Simulation.from_checkpoint(tmp_path / "again.h5", device="cpu", threads=1)
    third.step(150)
    straight = Simulation.from_checkpoint(saved, device="cpu", threads=1)
    straight.step(150)
    assert third.state_hash() == straight.state_hash()


@pytest.mark.parametrize("threads", [1, 2])
def test_resumed_run_equals_the_uninterrupted_one(box, tmp_path, threads, run):
    rolling = run.plan.contact.rolling
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


def test_history_is_in_the_checkpoint(run, saved):
    """Without the springs the run goes on otherwise: the test of equality above can see them."""
    kept = Simulation.from_checkpoint(saved, device="cpu", threads=1)
    bare = Simulation.from_checkpoint(saved, device="cpu", threads=1)
    data = checkpoint_file.read(saved)
    assert len(data["pair_history"]) > 20
    data["pair_history"][...] = 0.0
    checkpoint.restore(bare, data)
    for sim in (kept, bare):
        sim.step(20)
    assert kept.state_hash() != bare.state_hash()
    assert run.step_number == 801


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
        case "other names":
            with h5py.File(path, "r+") as file:
                names = {name: file[name][()] for name in file if name != "material"} | {"kind": file["material"][()]}
                file["kind"] = names["kind"]
                del file["material"]
                text = file.attrs["scene"] + file.attrs["about"]
                file.attrs["digest"] = checkpoint_file._digest(text, names)
        case "array gone":
            with h5py.File(path, "r+") as file:
                del file["record"]
        case "array short":
            with h5py.File(path, "r+") as file:
                short = file["record"][:-1]
                del file["record"]
                file["record"] = short
        case "one number changed":
            with h5py.File(path, "r+") as file:
                file["record"][3, 0] = np.nextafter(file["record"][3, 0], 1.0)
        case "step changed":
            with h5py.File(path, "r+") as file:
                file.attrs["about"] = file.attrs["about"].replace('"step": 801', '"step": 802')
        case "folder":
            path.unlink()
            path.mkdir()


KINDS = {
    "missing": "no checkpoint there",
    "empty": "damaged or not a checkpoint",
    "truncated": "damaged or not a checkpoint",
    "foreign": "damaged or not a checkpoint",
    "folder": "damaged or not a checkpoint",
    "other HDF5": "an HDF5 file, but not a checkpoint; this version reads 'warpdem checkpoint",
    "other version": "a checkpoint of another version .'warpdem checkpoint 0'.; this version reads 'warpdem checkpoint",
    "other names": "a checkpoint of another version: it holds no material; go on with the version that saved it",
    "array gone": "damaged",
    "array short": "damaged",
    "one number changed": "damaged",
    "step changed": "damaged",
}


@pytest.mark.parametrize("kind", KINDS)
def test_damaged_file_is_refused(saved, kind):
    damaged(kind, saved)
    with pytest.raises(SceneError, match=rf"saved\.h5: {KINDS[kind]}"):
        Simulation.from_checkpoint(saved, device="cpu", threads=1)


def test_no_damage_goes_unseen(run, saved):
    """Bytes of the file changed at random: refused in words, or what is read is what was saved."""
    rng, data, whole = np.random.default_rng(5), saved.read_bytes(), checkpoint_file.read(saved)
    refused = 0
    for _ in range(100):
        bytes_ = bytearray(data)
        bytes_[rng.integers(len(bytes_))] ^= 1 << rng.integers(8)
        saved.write_bytes(bytes_)
        try:
            found = checkpoint_file.read(saved)
        except SceneError as error:
            assert "saved.h5" in str(error)
            refused += 1
        else:
            assert found.keys() == whole.keys()
            assert all(np.array_equal(found[name], whole[name]) for name in whole)
    assert refused > 50


def test_checkpoint_of_another_scene_is_refused(box, run, saved):
    sim = Simulation(scene(box, friction=0.4, rolling=run.plan.contact.rolling), device="cpu", threads=1)
    sim.step(7)
    before = sim.state_hash()
    with pytest.raises(SceneError, match="saved.h5: belongs to another scene than <scene>: other values of pairs"):
        checkpoint.restore(sim, checkpoint_file.read(saved))
    assert (sim.step_number, sim.state_hash()) == (7, before)
    sim.step(1)


def test_edited_mesh_is_another_scene(box, run, saved, tmp_path):
    """The scene's words are the same, the file that it names is not."""
    mesh = tmp_path / "box.stl"
    mesh.write_bytes(box.read_bytes())
    first = Simulation(scene(mesh, rolling=run.plan.contact.rolling), device="cpu", threads=1)
    first.save_checkpoint(saved)
    data = bytearray(box.read_bytes())
    data[:5] = b"other"  # the title of the file: another mesh would be refused for more than one reason
    mesh.write_bytes(data)
    with pytest.raises(SceneError, match=r"another scene.*other contents of the file of walls\[0\].mesh"):
        Simulation.from_checkpoint(saved, device="cpu", threads=1)


def test_saving_replaces_the_old_file_at_once(run, saved, tmp_path):
    run.save_checkpoint(saved)
    assert [path.name for path in tmp_path.iterdir()] == ["saved.h5"]
    with pytest.raises(OutputError, match=r"folder.h5: cannot be written \(No such file or directory\)"):
        run.save_checkpoint(tmp_path / "no" / "such" / "folder.h5")


def test_full_disk_keeps_the_old_file(run, saved, tmp_path, file_size_limit):
    good = saved.read_bytes()
    with file_size_limit(len(good) // 2), pytest.raises(OutputError, match=r"saved.h5: cannot be written \(File too large\)"):
        run.save_checkpoint(saved)
    assert saved.read_bytes() == good
    assert [path.name for path in tmp_path.iterdir()] == ["saved.h5"]


def test_hourglass_resumes_from_random_moments_on_any_number_of_threads(tmp_path):
    """The main job with fewer grains, in its axes as they come to turn, saved at three moments on the way."""
    few = ["grains.0.fill.count=500", "grains.0.fill.region={min = [-2, -2, -3], max = [2, 2, -1.15]}"]
    hourglass = load_scene(HOURGLASS, few)
    moments, end = sorted(np.random.default_rng().integers(1, 3000, 3).tolist()), 3000
    whole = Simulation(hourglass, device="cpu", threads=2)
    for moment in moments:
        whole.step(moment - whole.step_number)
        whole.save_checkpoint(tmp_path / f"{moment}.h5")
    whole.step(end - whole.step_number)
    assert len(whole.contacts().i) > 100
    for moment in set(moments):
        for threads in (1, 2):
            again = Simulation.from_checkpoint(tmp_path / f"{moment}.h5", device="cpu", threads=threads)
            again.step(end - moment)
            assert again.state_hash() == whole.state_hash(), f"saved at step {moment}, {threads} threads"


def test_arrays_are_written_block_by_block(run, saved, tmp_path, monkeypatch):
    """Blocks of one row and of some rows hold what one block holds, and the digest goes over all of them."""
    whole = checkpoint_file.read(saved)
    for size in (1, 1000):
        monkeypatch.setattr(blocks, "BLOCK", size)
        run.save_checkpoint(tmp_path / "blocks.h5")
        found = checkpoint_file.read(tmp_path / "blocks.h5")
        assert found.keys() == whole.keys()
        for name, values in whole.items():
            np.testing.assert_array_equal(found[name], tmp_path / "blocks.h5" if name == "path" else values, err_msg=name)


def test_arrays_are_read_block_by_block(saved, monkeypatch):
    """Until they are asked for: the digest of the file takes no more than a block at a time."""
    largest, read = [], h5py.Dataset.__getitem__

    def noted(data, *key):
        largest.append(np.asarray(found := read(data, *key)).nbytes)
        return found

    monkeypatch.setattr(h5py.Dataset, "__getitem__", noted)
    monkeypatch.setattr(blocks, "BLOCK", 1000)
    with checkpoint_file.opened(saved) as contents:
        assert max(largest) <= 1000 < 0.1 * sum(largest)
        record = contents["record"]
    assert max(largest) == record.nbytes > 1000
    whole = checkpoint_file.read(saved)
    assert whole.keys() == contents.keys()
    np.testing.assert_array_equal(whole["record"], record)


def test_saving_takes_little_memory(tmp_path):
    """Less than half of what the file holds: neither the arrays in order nor the file are made as a whole."""
    place = np.stack(np.meshgrid(*[np.arange(40.0)] * 3, indexing="ij"), axis=-1).reshape(-1, 3)
    data = scene("box.stl").model_dump(mode="json", exclude={"walls", "frame", "source", "base"})
    data["grains"] = [{"material": "glass", "positions": 2.1e-3 * place, "radius": RADIUS}]
    sim = Simulation(Scene.model_validate(data), device="cpu", threads=1)
    sim.save_checkpoint(tmp_path / "saved.h5")
    tracemalloc.start()
    try:
        sim.save_checkpoint(tmp_path / "saved.h5")
        peak = tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()
    size = (tmp_path / "saved.h5").stat().st_size
    assert size > 12e6 and peak < 0.5 * size, (peak, size)


def test_contacts_that_the_lists_do_not_hold_any_more_are_left_out(run, saved):
    """Forces come back by pairs of ids: pairs of the file in any order, and one that no list has."""
    straight, data = Simulation.from_checkpoint(saved, device="cpu", threads=1), checkpoint_file.read(saved)
    there = {tuple(pair) for pair in data["pair"].tolist()}
    apart = next((a, b) for a in data["id"] for b in data["id"][::-1] if a < b and (a, b) not in there)
    order = np.random.default_rng(2).permutation(len(data["pair"]) + 1)
    for name in [name for name in data if name.startswith("pair")]:
        extra = [apart] if name == "pair" else np.ones((1, *data[name].shape[1:]))
        data[name] = np.concatenate([data[name], np.array(extra, dtype=data[name].dtype)])[order]
    again = Simulation(same_scene.scene_of(data), device="cpu", threads=1)
    checkpoint.restore(again, data)
    assert_equal_readings(straight, again)
    for sim in (straight, again):
        sim.step(100)
    assert straight.state_hash() == again.state_hash()
    assert run.step_number == 801
