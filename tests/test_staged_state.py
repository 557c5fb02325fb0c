"""What is told of an instant beside the run is what the run tells when it rests there."""

from dataclasses import fields, is_dataclass
from types import SimpleNamespace

import numpy as np
import pytest
import warp as wp

from warpdem import Scene, Simulation
from warpdem.app import outputs as app_outputs
from warpdem.app.outputs import Outputs
from warpdem.measure import observation
from warpdem.measure.column import Readings
from warpdem.measure.observers import Particles, read_contacts
from warpdem.measure.snapshot import take_snapshot
from warpdem.measure.totals import Totals
from warpdem.output.history import history_columns, history_row
from warpdem.output.staged_state import StagedState, StagingBuffer
from warpdem.scene.measures import Measures
from warpdem.state.listed_contacts import CONTACT_ARRAYS

STEPS = 800


def equal(a, b, name="") -> None:
    """Compare snapshots and their parts, bit for bit."""
    assert type(a) is type(b), name
    if is_dataclass(a):
        for field in fields(a):
            equal(getattr(a, field.name), getattr(b, field.name), f"{name}.{field.name}")
    elif isinstance(a, dict):
        assert a.keys() == b.keys(), name
        for key in a:
            equal(a[key], b[key], f"{name}.{key}")
    elif isinstance(a, (list, tuple)):
        for number, (x, y) in enumerate(zip(a, b, strict=True)):
            equal(x, y, f"{name}.{number}")
    else:
        np.testing.assert_array_equal(a, b, err_msg=name)


@pytest.fixture(scope="module")
def scene():
    """Streams, outlets, fields, flow, budgets, a turning floor in a turning frame (the kernels of test_budget); all outputs."""
    pair = {"materials": ["g", "g"], "restitution": 0.5, "friction": 0.5, "rolling_friction": 0.1}
    sizes = {"uniform": [3.5e-3, 4.5e-3]}
    start = {"min": [-0.01, -0.01, 0.002], "max": [0.01, 0.01, 0.012]}
    mouth = {"min": [-0.006, -0.006, 0.03], "max": [0.006, 0.006, 0.04]}
    return Scene.model_validate(
        {
            "materials": {"g": {"density": 2500.0, "young_modulus": 5e6, "poisson_ratio": 0.25}},
            "contact": {"rolling": "spring"},
            "pairs": [pair],
            "grains": [{"material": "g", "fill": {"box": start, "count": 40, "diameter": sizes, "seed": 1}}],
            "streams": [{"material": "g", "diameter": 4e-3, "box": mouth, "count_rate": 600.0, "velocity": [0, 0, -0.2]}],
            "outlets": [{"name": "hole", "box": {"min": [0.002, -0.02, -0.01], "max": [0.03, 0.02, 0.0035]}}],
            "walls": [
                {"name": "floor", "material": "g", "plane": {"point": [0, 0, 0], "normal": [0, 0, 1]},
                 "motion": {"axis": [0, 0, 1], "rate": 5.0}},
                {"name": "tube", "material": "g", "cylinder": {"point": [0, 0, 0], "axis": [0, 0, 1], "radius": 15e-3}},
            ],
            "fields": [
                {"model": "drag", "parameters": {"coefficient": 1e-4}},
                {"model": "harmonic", "axes": "frame", "parameters": {"stiffness": 1e-2, "centre": [4e-3, 0, 0.01]}},
            ],
            "frame": {"axis": [0, 0, 1], "origin": [0.01, 0, 0], "rate": 3.0},
            "measures": {
                "energy": True,
                "momentum": True,
                "flow": [{"name": "low", "point": [0, 0, 4.5e-3], "normal": [0, 0, -1]}],
                "mixing": [{"name": "sizes", "by": "size", "cell": 8e-3}],
                "regions": [{"name": "low", "box": {"min": [-1, -1, -1], "max": [1, 1, 0.01]}}],
            },
            "output": {"contacts": True},
            "time": {"end": 0.2, "step": 4e-5, "max_speed": 0.05},
        }
    )  # fmt: skip


@pytest.fixture
def sim(scene):
    made = Simulation(scene, device="cpu", threads=1)
    made.step(STEPS)
    return made


def row_of(view) -> list[float]:
    """The row of history.csv at the time of a view."""
    return history_row(history_columns(view.model.scene), Readings(view))


def spoil(sim) -> None:
    """Go on and overwrite what never changes, so that whoever looks at the run's own arrays sees others."""
    sim.step(STEPS)
    sim.coefficients.zero_()
    for name in ("wall", "material"):
        getattr(sim.walls.surface, name).fill_(99)


def test_an_instant_is_read_after_the_run_has_gone_on(sim):
    there, row = sim.snapshot(), row_of(sim.view)
    assert len(there.contacts.i) > 5 and (there.contacts.wall >= 0).any() and np.abs(row).sum() > 0.0
    instant = StagedState(sim.view, StagingBuffer(sim.device))
    spoil(sim)
    still = instant.view()
    equal(take_snapshot(still), there)
    assert row_of(still) == row
    assert (still.clock.step_number, still.clock.time) == (STEPS, STEPS * sim.dt)


def test_instants_do_not_change_the_run(scene, sim):
    for _ in range(3):
        take_snapshot(StagedState(sim.view, StagingBuffer(sim.device)).view())
        sim.step(20)
    other = Simulation(scene, device="cpu", threads=1)
    other.step(STEPS + 60)
    assert sim.state_hash() == other.state_hash()


def test_a_room_is_used_again_when_there_is_more_to_hold(scene):
    sim = Simulation(scene, device="cpu", threads=1)
    room, counts = StagingBuffer(sim.device), []
    for _ in range(3):
        there, instant = sim.snapshot(), StagedState(sim.view, room)
        sim.step(STEPS)
        equal(take_snapshot(instant.view()), there)
        counts.append(len(there.contacts.i))
    assert counts[0] < counts[-1]


def test_contacts_that_were_not_asked_for_are_not_those_of_a_later_time(sim):
    still = StagedState(sim.view, StagingBuffer(sim.device), contacts=False).view()
    assert all(getattr(still.contacts, name) is None for name in CONTACT_ARRAYS)
    equal(Particles(still).force, sim.particles.force)
    with pytest.raises(AssertionError):
        read_contacts(still)
    assert observation.observed(sim.view) == {}


def test_walls_and_grains_are_read_of_an_instant_without_contacts(sim):
    """As of a frame that shows no contacts: the loads on walls are told, what the springs store is not."""
    there = Totals(sim.view)
    assert len(there.part.contacts) > 5
    still = Totals(StagedState(sim.view, StagingBuffer(sim.device), contacts=False).view())
    np.testing.assert_array_equal(still.walls, there.walls)
    np.testing.assert_array_equal(still.grains["momentum"], there.grains["momentum"])
    with pytest.raises(AssertionError):
        _ = still.elastic


def test_there_is_an_instant_before_the_first_grain(scene):
    """All of them come by a stream, the first after some steps."""
    scene = scene.model_copy(update={"grains": []})
    sim = Simulation(scene, device="cpu", threads=1)
    still = StagedState(sim.view, StagingBuffer(sim.device)).view()
    equal(take_snapshot(still), sim.snapshot())
    assert len(sim.state) == 0
    np.testing.assert_array_equal(row_of(still), row_of(sim.view))
    sim.step(STEPS)
    assert len(sim.state) > 0


class SideStream:
    """Stands for a stream of a GPU: what is sent has arrived at the second look."""

    def __init__(self, device) -> None:
        self.device, self.waited_for, self.looks = device, [], 0

    def wait_stream(self, other) -> None:
        self.waited_for.append(other)

    def record_event(self) -> "SideStream":
        return self

    @property
    def is_complete(self) -> bool:
        self.looks += 1
        return self.looks > 1


def test_from_a_gpu_goes_what_was_there_when_it_was_taken(monkeypatch):
    asked, empty = [], wp.empty
    monkeypatch.setattr(wp, "Stream", SideStream)
    monkeypatch.setattr(wp, "empty", lambda *shape, pinned, **keys: (asked.append(pinned), empty(*shape, **keys))[1])
    room = StagingBuffer(SimpleNamespace(is_cuda=True, stream="the run's"))
    array = wp.full(5, 1.0, dtype=wp.float64, device="cpu")
    host = room.take("a", array)
    array.fill_(2.0)  # the run goes on
    room.send()
    assert asked == [True] and room._stream.waited_for == ["the run's"]
    room.wait()
    assert room._stream.looks == 2
    np.testing.assert_array_equal(host.numpy(), 1.0)


def written(sim, folder, frame: bool) -> list[str]:
    """The last line of history.csv after the present time was written, with a frame or without."""
    outputs = Outputs(sim, folder)
    outputs.write(row=True, frame=frame)
    outputs.close()
    return (folder / "history.csv").read_text().splitlines()[-1].split(",")


def test_a_row_alone_is_that_with_a_frame_and_copies_the_run_only_where_it_reads_grains(scene, sim, tmp_path, monkeypatch):
    plain = scene.model_copy(update={"frame": None, "walls": scene.walls[1:], "measures": Measures(), "observers": []})
    resting = Simulation(plain, device="cpu", threads=1)
    resting.step(STEPS)
    copied = []
    monkeypatch.setattr(app_outputs, "StagedState", lambda *args, **keys: copied.append(1) or StagedState(*args, **keys))
    for number, (run, copies) in enumerate(((resting, 0), (sim, 1))):
        copied.clear()
        alone = written(run, tmp_path / f"{number} alone", frame=False)
        assert len(copied) == copies
        assert alone == written(run, tmp_path / f"{number} with a frame", frame=True)
        assert run.rows.table()[:, 0].tolist() == [run.time]
