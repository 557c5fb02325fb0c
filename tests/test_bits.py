"""The contract on bits: threads, skin, rebuilds, memory order, reading and resume do not change a run."""

import numpy as np
import pytest
import trimesh

from warpdem import Scene, Simulation

STEPS = 700
HALF = 337
RADIUS = 1.0e-3


@pytest.fixture(scope="module")
def box(tmp_path_factory):
    path = tmp_path_factory.mktemp("bits") / "box.stl"
    trimesh.creation.box((18e-3, 18e-3, 20e-3)).export(path)
    return path


def bed(box, rolling: str, skin: float = 0.4 * RADIUS, order=slice(None)) -> Scene:
    """216 grains that fall, slide and roll in a box whose turning ramps up, goes on and stops at once."""
    rng = np.random.default_rng(1)
    cell = np.stack(np.meshgrid(*[np.arange(6)] * 3, indexing="ij"), axis=-1).reshape(-1, 3)
    position = (cell - 2.5) * 2.15e-3 + [0.0, 0.0, -3e-3]
    n = len(position)
    radius = rng.uniform(0.9, 1.1, n) * RADIUS
    velocity, spin = rng.normal(0.0, 0.1, (n, 3)), rng.normal(0.0, 30.0, (n, 3))
    ids = rng.permutation(n) * 3 + 5
    return Scene.model_validate(
        {
            "gravity": [0, 0, -60],
            "materials": {"glass": {"density": 2500, "young_modulus": 4e6, "poisson_ratio": 0.3}},
            "contact": {"normal": "hertz", "tangential": "mindlin", "rolling": rolling},
            "pairs": [{"materials": ["glass", "glass"], "restitution": 0.6, "friction": 0.5, "rolling_friction": 0.2}],
            "grains": [
                {
                    "material": "glass",
                    "positions": position[order],
                    "radii": radius[order],
                    "velocities": velocity[order],
                    "spins": spin[order],
                    "ids": ids[order],
                }
            ],
            "walls": [{"name": "box", "material": "glass", "mesh": str(box)}],
            "frame": {
                "axis": [0, 1, 0.2],
                "origin": [0, 0, 5e-3],
                "schedule": [{"until": 6e-3, "rate": [0, 40]}, {"until": 10e-3, "rate": 40}, {"rate": 0}],
            },
            "time": {"end": 1, "step": 2e-5, "max_speed": 1},
            "engine": {"skin": skin, "max_overlap": 0.3},
        }
    )


@pytest.fixture(scope="module", params=["constant", "spring"])
def rolling(request):
    return request.param


@pytest.fixture(scope="module")
def reference(box, rolling):
    """An uninterrupted run on one thread."""
    sim = Simulation(bed(box, rolling), device="cpu", threads=1)
    sim.step(STEPS)
    return sim


def test_the_bed_flows_and_remembers(reference, box, rolling):
    """Without motion, rebuilds and stretched springs the other tests would prove nothing."""
    start = Simulation(bed(box, rolling), device="cpu", threads=1).particles.position
    assert np.linalg.norm(reference.particles.position - start, axis=1).min() > 0.5 * RADIUS
    contacts = reference.contacts()
    assert (contacts.j >= 0).sum() > 80
    assert (contacts.j < 0).sum() > 20
    assert np.count_nonzero(np.linalg.norm(contacts.spring, axis=1)) > 80
    assert reference.lists.rebuilds > 10


@pytest.mark.parametrize("threads", [1, 2, 3])
def test_threads_and_repetition_change_no_bit(reference, box, rolling, threads):
    sim = Simulation(bed(box, rolling), device="cpu", threads=threads)
    sim.step(STEPS)
    assert sim.state_hash() == reference.state_hash()


def test_skin_changes_no_bit(reference, box, rolling):
    rebuilds = {reference.lists.rebuilds}
    for share in (0.1, 0.2, 0.5):
        sim = Simulation(bed(box, rolling, skin=share * RADIUS), device="cpu", threads=1)
        sim.step(STEPS)
        assert sim.state_hash() == reference.state_hash(), f"skin of {share} radii"
        rebuilds.add(sim.lists.rebuilds)
    assert len(rebuilds) == 4, "each skin must rebuild at its own times"


def test_order_of_grains_changes_no_bit(reference, box, rolling):
    order = np.random.default_rng(2).permutation(216)
    sim = Simulation(bed(box, rolling, order=order), device="cpu", threads=1)
    sim.step(STEPS)
    assert sim.state_hash() == reference.state_hash()
    np.testing.assert_array_equal(sim.particles.radius, reference.particles.radius)


def test_reading_between_odd_batches_changes_no_bit(reference, box, rolling):
    sim = Simulation(bed(box, rolling), device="cpu", threads=1)
    for k, batch in enumerate((1, 1, 2, 3, 7, 61, 128, 255, 256, 257)):
        sim.step(min(batch, STEPS - sim.step_number))
        reads = (lambda: sim.particles.velocity, sim.contacts, sim.energy, sim.snapshot, sim.loads, sim.state_hash)
        reads[k % 6]()
        reads[(k + 3) % 6]()
    assert sim.step_number == STEPS
    assert sim.state_hash() == reference.state_hash()


def test_what_is_read_does_not_depend_on_the_lists(reference, box, rolling):
    sim = Simulation(bed(box, rolling, skin=0.2 * RADIUS), device="cpu", threads=2)
    sim.step(STEPS)

    def sorted_contacts(of):
        c = of.contacts()
        order = np.lexsort((*c.point.T, c.j, c.i))
        return np.column_stack([c.i, c.j, c.overlap, c.normal, c.force, c.spring])[order]

    np.testing.assert_array_equal(sim.particles.velocity, reference.particles.velocity)
    np.testing.assert_array_equal(sim.particles.spin, reference.particles.spin)
    np.testing.assert_array_equal(np.array(sim.loads()), np.array(reference.loads()))
    np.testing.assert_array_equal(sorted_contacts(sim), sorted_contacts(reference))


def test_rebuild_at_every_refresh_changes_no_bit(reference, box, rolling):
    sim = Simulation(bed(box, rolling), device="cpu", threads=1)
    update = sim.lists.update
    sim.lists.update = lambda grown: update(force_rebuild=True)
    sim.step(STEPS)
    assert sim.lists.rebuilds == sim.lists.inner_rebuilds > reference.lists.rebuilds
    assert sim.state_hash() == reference.state_hash()


def test_inner_skin_changes_no_bit(reference, box, rolling):
    sim = Simulation(bed(box, rolling), device="cpu", threads=1)
    while sim.step_number < STEPS:
        sim.lists.inner_share *= 0.2  # thinner is always safe: the list holds more than is asked for
        sim.step(min(50, STEPS - sim.step_number))
    assert sim.lists.inner_rebuilds > 1.2 * reference.lists.inner_rebuilds
    assert sim.state_hash() == reference.state_hash()


@pytest.mark.parametrize(("half", "threads"), [(0, 1), (1, 3), (HALF, 1), (HALF, 3)])
def test_resume_changes_no_bit(reference, box, rolling, tmp_path, half, threads):
    first = Simulation(bed(box, rolling), device="cpu", threads=1)
    first.step(half)
    first.save_checkpoint(tmp_path / "half.h5")
    then = first.state_hash()
    second = Simulation.from_checkpoint(tmp_path / "half.h5", device="cpu", threads=threads)
    assert second.step_number == half
    assert second.state_hash() == then
    second.step(STEPS - half)
    assert second.state_hash() == reference.state_hash()
    if threads == 1:
        first.step(STEPS - half)
        assert first.state_hash() == reference.state_hash(), "saving must not change the run that saves"


def test_hash_tells_runs_apart(reference, box, rolling):
    """One step, one id or one bit of one grain makes another hash."""
    sim = Simulation(bed(box, rolling), device="cpu", threads=1)
    sim.step(STEPS - 1)
    assert sim.state_hash() != reference.state_hash()
    before = sim.state_hash()
    record = sim.state.record.numpy()
    record[7, 0] = np.nextafter(record[7, 0], 1.0)
    sim.state.record.assign(record)
    assert sim.state_hash() != before
