"""Contact batches that threads take of each other: all of them are taken once, also those of a thread that has not come."""

import numpy as np
import pytest
import warp as wp
from warpdem.kernels import MODULE_OPTIONS
from warpdem.kernels.step import portions
from warpdem.kernels.step.structs import SPAN

from warpdem import Scene, Simulation
from warpdem.core.threads import Threads
from warpdem.engine import cpu

COUNT = 200_000


@wp.kernel(enable_backward=False, module="unique", module_options=MODULE_OPTIONS)
def take_all(portion: int, taken: wp.array(dtype=wp.int32), times_out: wp.array(dtype=wp.int32)):
    first = int(portions.take(taken, 3, portion))
    while first < times_out.shape[0]:
        for i in range(first, wp.min(first + portion, times_out.shape[0])):
            times_out[i] += 1
        first = portions.take(taken, 3, portion)


@wp.kernel(enable_backward=False, module="unique", module_options=MODULE_OPTIONS)
def lengths(threads: int, batches: wp.array(dtype=wp.int32), portion_out: wp.array(dtype=wp.int32)):
    i = wp.tid()
    portion_out[i] = portions.portion_of(batches[i], threads)


def test_threads_that_take_at_the_same_time_take_each_once():
    threads = Threads(3)
    taken, times = wp.zeros(4, dtype=wp.int32, device="cpu"), wp.zeros(COUNT, dtype=wp.int32, device="cpu")
    wp.load_module(take_all.module, device="cpu")
    threads.together([lambda: wp.launch(take_all, 1, [1, taken, times], device="cpu")] * 3)
    threads.close()
    assert taken.numpy()[:3].max() == 0
    assert taken.numpy()[3] == COUNT + 3
    np.testing.assert_array_equal(times.numpy(), 1)


@pytest.mark.parametrize(("threads", "wanted"), [(1, [0, 5, 10_000]), (2, [8, 8, 417])])
def test_portions_are_all_for_one_thread_and_parts_for_several(threads, wanted):
    batches = wp.array([0, 5, 10_000], dtype=wp.int32, device="cpu")
    found = wp.zeros(3, dtype=wp.int32, device="cpu")
    wp.launch(lengths, 3, [threads, batches, found], device="cpu")
    assert found.numpy().tolist() == wanted


def bed() -> Scene:
    """343 grains that are pressed into each other."""
    place = 1.95e-3 * np.stack(np.meshgrid(*[np.arange(7)] * 3, indexing="ij"), axis=-1).reshape(-1, 3)
    return Scene.model_validate(
        {
            "materials": {"glass": {"density": 2500, "young_modulus": 4e6, "poisson_ratio": 0.3}},
            "pairs": [{"materials": ["glass", "glass"], "restitution": 0.6, "friction": 0.5}],
            "grains": [{"material": "glass", "positions": place, "radius": 1e-3}],
            "time": {"end": 1, "step": 2e-6},
        }
    )


def test_a_thread_without_contacts_takes_those_of_another(monkeypatch):
    """And the bits stay; a thread that has taken some knows how fast pairs approach."""
    alone = Simulation(bed(), device="cpu", threads=1)
    alone.step(400)
    monkeypatch.setattr(cpu, "ranges", lambda count, parts: [(0, count), *[(count, count)] * (parts - 1)])
    sim = Simulation(bed(), device="cpu", threads=2)
    sim.step(400)
    assert sim.state_hash() == alone.state_hash()
    for _ in range(100):
        if sim.engine.batch.report.extreme.numpy()[SPAN + 1] > 0.0:
            break
        sim.step(50)
    assert sim.engine.batch.report.extreme.numpy()[SPAN + 1] > 0.0
