"""Resident stepping: the GPU's launches, captured as one graph and replayed on a CPU, give the bits of the CPU's own loop."""

import numpy as np
import pytest
import trimesh
import warp as wp

from warpdem import Scene, SceneError, Simulation
from warpdem.engine import graph as graph_executor
from warpdem.engine.cpu import CpuExecutor
from warpdem.engine.graph import GraphExecutor
from warpdem.measure.observers import read_contacts
from warpdem.measure.snapshot import take_snapshot
from warpdem.output.staged_state import StagedState, StagingBuffer

STEPS = 150
RADIUS = 1.0e-3


@pytest.fixture(scope="module")
def box(tmp_path_factory):
    path = tmp_path_factory.mktemp("resident") / "box.stl"
    trimesh.creation.box((12e-3, 12e-3, 14e-3)).export(path)
    return str(path)


def bed(walls: list[dict], integrator: str = "exact_drift", precision: str = "double", measures: dict | None = None, **more):
    """64 grains that fall, slide and roll, in a frame whose turning ramps up and stops at once."""
    rng = np.random.default_rng(1)
    cell = np.stack(np.meshgrid(*[np.arange(4)] * 3, indexing="ij"), axis=-1).reshape(-1, 3)
    n = len(cell)
    data = {
        "gravity": [0, 0, -60],
        "materials": {"glass": {"density": 2500, "young_modulus": 4e6, "poisson_ratio": 0.3}},
        "contact": {"normal": "hertz", "tangential": "mindlin", "rolling": "spring"},
        "pairs": [{"materials": ["glass", "glass"], "restitution": 0.6, "friction": 0.5, "rolling_friction": 0.2}],
        "grains": [
            {
                "material": "glass",
                "positions": (cell - 1.5) * 2.2e-3 + [0.0, 0.0, -2.4e-3],
                "radii": rng.uniform(0.9, 1.1, n) * RADIUS,
                "velocities": rng.normal(0.0, 0.1, (n, 3)),
                "spins": rng.normal(0.0, 30.0, (n, 3)),
                "ids": rng.permutation(n) * 3 + 5,
            }
        ],
        "walls": walls,
        "frame": {
            "axis": [0, 1, 0.2],
            "schedule": [{"until": 1e-3, "rate": [0, 40]}, {"until": 2e-3, "rate": 40}, {"rate": 0}],
        },
        "time": {"end": 1, "step": 1e-5, "max_speed": 1},
        "engine": {"skin": 0.8 * RADIUS, "max_overlap": 0.3, "integrator": integrator, "precision": precision},
        "measures": measures or {},
    }
    return Scene.model_validate(data | more)


def both(scene: Scene, steps: int = STEPS) -> tuple[Simulation, Simulation]:
    """The same steps by the CPU's loop and by the graph."""
    own, graph = (Simulation(scene, device="cpu", threads=1, resident=resident) for resident in (False, True))
    for sim in (own, graph):
        sim.step(steps)
    return own, graph


@pytest.fixture(scope="module")
def in_a_box(box):
    return both(bed([{"name": "box", "material": "glass", "mesh": box}]), 3 * STEPS)


def test_graph_gives_the_bits_of_the_loop(in_a_box):
    own, graph = in_a_box
    assert own.state_hash() == graph.state_hash()
    assert own.extremes == graph.extremes
    assert own.extremes["pair_overlap_share"] > 0.0 < own.extremes["wall_overlap_share"]


def test_inner_lists_are_built_in_the_graph(in_a_box):
    own, graph = in_a_box
    resident = graph.engine.executor
    assert resident.inner_builds > 3
    assert graph.lists.inner_rebuilds == graph.lists.version + resident.inner_builds
    # not much more often than by the host, which steers the margin at each
    assert graph.lists.inner_rebuilds < 1.5 * own.lists.inner_rebuilds
    assert resident.captures <= graph.lists.version + graph.lists.flights.laid, "paths are in arrays of their own"


def test_outer_lists_are_built_in_the_graph(in_a_box):
    own, graph = in_a_box
    resident = graph.engine.executor
    assert resident.outer_builds > 1
    assert graph.lists.rebuilds == graph.lists.version + resident.outer_builds >= own.lists.rebuilds


def test_nothing_is_allocated_while_a_graph_is_captured(box, monkeypatch):
    """CUDA allows no allocation within a branch of a graph."""
    sim = Simulation(bed([{"name": "box", "material": "glass", "mesh": box}]), device="cpu", threads=1, resident=True)
    loop, asked, allocator = graph_executor.Captured.loop, [], type(sim.device.get_allocator())
    allocate = allocator.allocate

    def noted(self, size):
        asked.append(size)
        return allocate(self, size)

    def watched(launches):
        with monkeypatch.context() as patch:
            patch.setattr(allocator, "allocate", noted)
            loop(launches)

    monkeypatch.setattr(graph_executor.Captured, "loop", watched)
    sim.step(STEPS)
    assert sim.engine.executor.captures > 0
    assert not asked


def test_readers_see_the_lists_of_the_device(in_a_box):
    own, graph = in_a_box
    for a, b in zip(own.readings(), graph.readings(), strict=True):
        np.testing.assert_array_equal(a, b)
    a, b = own.contacts(), graph.contacts()
    assert len(a.i) > 20 and (a.j < 0).any()
    # beside a wall as many places as there are; of pairs, those that touch: in any order
    first, second = (np.lexsort((c.j, c.i)) for c in (a, b))
    np.testing.assert_array_equal(np.stack([a.i, a.j])[:, first], np.stack([b.i, b.j])[:, second])
    np.testing.assert_array_equal(a.overlap[first], b.overlap[second])
    np.testing.assert_array_equal(own.wall_loads()["box"].force, graph.wall_loads()["box"].force)


def test_an_instant_of_the_graph_is_read_without_the_device(in_a_box, monkeypatch):
    _, graph = in_a_box
    there, contacts = graph.snapshot(), graph.contacts()
    still = StagedState(graph.view, StagingBuffer(graph.device)).view()

    launch = wp.launch

    def on_host(kernel, *arguments, device=None, **keys):
        assert wp.get_device(device).is_cpu, f"{kernel.key} where files are written, while the run may capture a graph"
        return launch(kernel, *arguments, device=device, **keys)

    monkeypatch.setattr(wp, "launch", on_host)
    for name, values in vars(contacts).items():
        np.testing.assert_array_equal(getattr(read_contacts(still), name), values)
    shown = take_snapshot(still)
    for name in ("position", "velocity", "spin", "force"):
        np.testing.assert_array_equal(getattr(shown, name), getattr(there, name))
    np.testing.assert_array_equal(shown.loads["box"].force, there.loads["box"].force)


def test_a_checkpoint_goes_from_the_graph_to_the_loop(in_a_box, tmp_path):
    own, graph = in_a_box
    graph.save_checkpoint(tmp_path / "c.h5")
    again = Simulation.from_checkpoint(tmp_path / "c.h5", device="cpu", threads=1)
    assert again.state_hash() == own.state_hash()
    straight = Simulation(own.model.given.scene, device="cpu", threads=1)
    straight.step(3 * STEPS + 40)
    again.step(40)
    assert again.state_hash() == straight.state_hash()


CASES = {
    "mixed, periodic, budgets, outlet": {
        "precision": "mixed",
        "measures": {"energy": True, "momentum": True},
        "frame": None,
        "borders": {"x": {"min": -5e-3, "max": 5e-3, "kind": "periodic"}},
        "outlets": [{"name": "side", "box": {"min": [-5e-3, 3.35e-3, -1e-2], "max": [5e-3, 1e-2, 1e-2]}}],
    },
    "stages": {"integrator": "rk2"},
    "relative, moving walls": {"integrator": "scovel", "fixed_to": "laboratory", "motion": [{"axis": [0, 0, 1], "rate": 30.0}]},
    "no walls": {"walls": [], "gravity": [0, 0, 0]},
}
SLOW = [pytest.param(name, marks=pytest.mark.slow) for name in list(CASES)[1:]]


@pytest.mark.parametrize("case", [next(iter(CASES)), *SLOW])
def test_graph_of_other_plans(case):
    keys = dict(CASES[case])
    floor = {"name": "floor", "material": "glass", "plane": {"point": [0, 0, -7e-3], "normal": [0, 0, 1]}}
    floor |= {name: keys.pop(name) for name in ("fixed_to", "motion") if name in keys}
    own, graph = both(bed(**{"walls": [floor], **keys}))
    assert own.state_hash() == graph.state_hash()
    assert own.extremes == graph.extremes
    assert graph.extremes["pair_overlap_share"] > 0.0
    if own.budget is not None:
        assert own.left == graph.left and own.left["side"][0] > 0
        for name, values in own.engine.read_sums().items():
            np.testing.assert_array_equal(values[own.state.rank], graph.engine.read_sums()[name][graph.state.rank])
        np.testing.assert_array_equal(own.engine.digits["losses"], graph.engine.digits["losses"])
        # what is carried over the border is added up where lists are built, which is not at the same steps
        assert own.budget.energy() == pytest.approx(graph.budget.energy(), rel=1e-6)


def test_a_gpu_only_steps_by_graph(device):
    if device == "cpu":
        assert isinstance(Simulation(bed([]), device=device, threads=1).engine.executor, CpuExecutor)
    else:
        assert isinstance(Simulation(bed([]), device=device).engine.executor, GraphExecutor)
        with pytest.raises(SceneError, match="no other way"):
            Simulation(bed([]), device=device, resident=False)


def test_two_runs_on_a_gpu_have_equal_bits(box):
    if not wp.get_cuda_device_count():
        pytest.skip("no GPU on this machine")
    scene = bed([{"name": "box", "material": "glass", "mesh": box}])
    hashes = set()
    for _ in range(2):
        sim = Simulation(scene, device="cuda:0")
        sim.step(STEPS)
        hashes.add(sim.state_hash())
    assert len(hashes) == 1
