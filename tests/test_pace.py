"""Threads at work on a machine that others use too: fewer where that is faster, all where cores are free."""

import numpy as np
import pytest

from warpdem import Simulation
from warpdem.engine.pace import PATIENCE, WINDOW, Pace


def course(most: int, per_step, got, seconds: float) -> list[int]:
    """Threads at work in each batch of a run; ``per_step`` [s] and ``got`` (cores) are functions of threads and time [s]."""
    pace, now, counts = Pace(), 0.0, []
    while now < seconds:
        count = pace.threads(most)
        counts.append(count)
        wall = 0.03
        pace.done(most, max(1, round(wall / per_step(count, now))), wall, got(count, now) * wall)
        now += wall
    return counts


def test_free_cores_are_all_used_all_the_time():
    """Whatever the time of a step does meanwhile."""
    noise = np.random.default_rng(3)
    counts = course(8, lambda n, t: 1e-3 / n * noise.uniform(0.5, 2.0), lambda n, t: noise.uniform(0.85, 1.0) * n, 60.0)
    assert set(counts) == {8}


@pytest.mark.parametrize("most", [2, 8])
def test_threads_that_wait_for_cores_become_fewer(most):
    """Each meeting costs the slice of another program; one thread needs none."""
    counts = course(most, lambda n, t: 1e-4 / n + (1.5e-3 if n > 1 else 0.0), lambda n, t: 1.0 if n == 1 else 0.2 * n, 120.0)
    assert counts[0] == most
    late = counts[len(counts) // 2 :]
    assert late.count(1) > 0.97 * len(late)


def test_what_is_not_faster_is_taken_back():
    """Half a core for each of two threads, and one for one: the trials stay rare."""
    counts = course(2, lambda n, t: 1e-3, lambda n, t: 1.0, 120.0)
    assert counts.count(1) * 0.03 < 20 * WINDOW


def test_cores_that_become_free_are_taken_again():
    def per_step(n, t):
        return 1e-4 / n + (1.5e-3 if n > 1 and t < 30.0 else 0.0)

    counts = course(4, per_step, lambda n, t: n if t > 30.0 else 0.3 * n, 30.0 + 3 * PATIENCE[1])
    assert counts[900] == 1 and counts[-1] == 4


def test_bits_do_not_depend_on_it(make_scene, monkeypatch):
    """A machine that is never free, and one where each batch changes the number."""
    rng = np.random.default_rng(5)
    cell = np.stack(np.meshgrid(*[np.arange(4)] * 3, indexing="ij"), axis=-1).reshape(-1, 3)
    scene = make_scene(cell * 2.02e-3, step=1e-5, velocities=rng.normal(0, 0.3, (64, 3)), max_speed=1.0)
    monkeypatch.setattr("warpdem.core.threads.available_cores", lambda: 3)
    hashes = set()
    for counts in ([1], [2], [1, 2, 3, 2]):
        sim = Simulation(scene, device="cpu")
        assert sim.threads.count == 2
        order = iter(counts * 100)
        monkeypatch.setattr(sim.engine.executor.pace, "threads", lambda most, order=order: min(most, next(order)))
        for _ in range(20):
            sim.step(20)
        hashes.add(sim.state_hash())
    assert len(hashes) == 1


def test_a_number_that_was_asked_for_is_obeyed(make_scene, monkeypatch):
    sim = Simulation(make_scene([[0, 0, 0], [0, 0, 3e-3]], step=1e-5), device="cpu", threads=2)
    assert sim.threads.count == 2
    used = []
    together = sim.threads.together
    monkeypatch.setattr(sim.threads, "together", lambda jobs: (used.append(len(jobs)), together(jobs)))
    monkeypatch.setattr(sim.engine.executor.pace, "threads", lambda most: 1)
    sim.step(5)
    assert max(used) == 2
    assert Simulation(make_scene([[0, 0, 0], [0, 0, 3e-3]], step=1e-5), device="cpu").threads.count == 1
