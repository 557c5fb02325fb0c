"""What a notebook shows: a picture of a simulation or of results, and a progress bar without widgets."""

import sys
from io import BytesIO, StringIO
from types import ModuleType, SimpleNamespace

import imageio.v2 as imageio
import pytest
from rich.console import Console

import warpdem
from warpdem.core.progress import progress_bar, report_if_long, report_state
from warpdem.output.write_vtk import VtkWriter

SCENE = {
    "gravity": [0, 0, 0],
    "materials": {"g": {"density": 2500.0, "young_modulus": 5e6, "poisson_ratio": 0.3}},
    "contact": {"normal": "hertz", "tangential": "mindlin", "rolling": "none"},
    "pairs": [{"materials": ["g", "g"], "restitution": 0.5, "friction": 0.5}],
    "grains": [{"material": "g", "positions": [[0, 0, 0], [0.01, 0, 0]], "radius": 4e-3}],
    "time": {"end": 1e-3, "step": 1e-5, "max_speed": 1.0},
}


def test_simulation_and_results_show_the_same_picture(tmp_path):
    sim = warpdem.Simulation(warpdem.Scene.model_validate(SCENE), device="cpu", threads=1)
    look = {"size": (256, 192), "colour": "id"}
    shown = warpdem.picture(sim, **look)
    assert imageio.imread(BytesIO(shown._repr_png_())).shape[:2] == (192, 256)
    VtkWriter(tmp_path, sim.wall_meshes()).write(sim.snapshot())
    assert warpdem.picture(tmp_path, **look).png == shown.png
    assert shown.save(tmp_path / "a.png").read_bytes() == shown.png
    assert warpdem.picture(sim, size=(256, 192), colour="id", zoom=0.5).png != shown.png


def test_a_simulation_shows_its_contacts_though_its_scene_does_not_write_them():
    near = {"material": "g", "positions": [[0, 0, 0], [7.9e-3, 0, 0]], "radius": 4e-3}
    sim = warpdem.Simulation(warpdem.Scene.model_validate({**SCENE, "grains": [near]}), device="cpu", threads=1)
    sim.step(1)
    red = []
    for chains in (False, True):
        image = imageio.imread(BytesIO(warpdem.picture(sim, size=(256, 192), colour="type", chains=chains).png)).astype(int)
        red.append((image[:130, :192, 0] - image[:130, :192, 2] > 90).any())  # above the axes
    assert red == [False, True]


def test_what_is_not_there_is_not_there():
    with pytest.raises(AttributeError, match="no attribute 'pictur'"):
        warpdem.pictur  # noqa: B018


class Display:
    """Stands for IPython.display: keeps what is shown, and what it is changed to."""

    def __init__(self):
        self.texts = []

    def display(self, thing, display_id):
        assert display_id is True
        return SimpleNamespace(update=self.show)

    def show(self, thing):
        self.texts.append(thing._repr_mimebundle_([], [])["text/plain"])


def test_progress_in_a_notebook_needs_no_widgets(monkeypatch):
    shown = Display()
    module = ModuleType("IPython.display")
    module.display = shown.display
    monkeypatch.setitem(sys.modules, "IPython", ModuleType("IPython"))
    monkeypatch.setitem(sys.modules, "IPython.display", module)
    with progress_bar(Console(force_jupyter=True, file=StringIO()), False, 10) as report:
        report(5, "t = 1 s")
        report(10, "t = 2 s")
    assert "t = 1 s" in shown.texts[0]
    assert "t = 2 s" in shown.texts[-1]
    assert shown.texts[0].count("━") > 5  # the bar


def test_progress_is_shown_in_a_terminal_and_nowhere_else():
    for terminal, quiet in ((True, False), (True, True), (False, False)):
        out = StringIO()
        with progress_bar(Console(force_terminal=terminal, file=out, width=120), quiet, 10) as report:
            report(5, "half of it")
        assert ("half of it" in out.getvalue()) == (terminal and not quiet)


@pytest.mark.parametrize(("quiet", "lines"), [(False, [" 50%  half of it  about 1 min 40 s left"]), (True, [])])
def test_where_there_is_no_terminal_lines_tell_the_progress(monkeypatch, capfd, quiet, lines):
    """A step in two seconds; a line is due after ten. The run goes on at step 40, which does not count as speed."""
    clock = iter([0.0, 0.0, 6.0, 20.0, 26.0])
    monkeypatch.setattr("warpdem.core.progress.time", SimpleNamespace(perf_counter=lambda: next(clock)))
    with progress_bar(Console(file=StringIO()), quiet, 100) as report:
        for step, state in ((40, "first"), (43, "too soon"), (50, "half of it"), (53, "too soon again")):
            report(step, state)
    assert capfd.readouterr().err.splitlines() == lines


@pytest.mark.parametrize(("quiet", "lines"), [(False, ["packing: 12.0 s", "packed: 31.0 s"]), (True, [])])
def test_what_takes_long_before_the_run_is_told_by_lines(monkeypatch, capfd, quiet, lines):
    clock = iter([0.0, 3.0, 12.0, 13.0, 31.0])
    monkeypatch.setattr("warpdem.core.progress.time", SimpleNamespace(perf_counter=lambda: next(clock)))
    with report_if_long("setting up", Console(file=StringIO()), quiet):
        for state in ("too soon", "packing:", "too soon again", "packed:"):
            report_state(state)
    report_state("nobody asked")
    assert [line.replace(":,", ":") for line in capfd.readouterr().err.splitlines()] == lines


def test_what_takes_long_before_the_run_is_shown_in_a_terminal(monkeypatch):
    monkeypatch.setattr("warpdem.core.progress.LONG", 0.0)
    monkeypatch.setattr("warpdem.core.progress.REFRESH", 0.0)
    out = StringIO()
    with report_if_long("setting up", Console(force_terminal=True, file=out, width=120), False):
        report_state("packing [5] grains")
        report_state("packing [6] grains")
    assert "packing [6] grains" in out.getvalue()
