"""What a program that listens hears of its runs, and what is shown of the things it holds."""

import logging
import subprocess
import sys

import twelve_grains
from warpdem import Simulation

LOUD = {"output": {"interval": 2e-3, "formats": [], "picture": False}, "materials": {"glass": {
    "density": 2500, "young_modulus": 1e7, "poisson_ratio": 0.3}}, "pairs": [
    {"materials": ["glass", "glass"], "restitution": 0.01, "friction": 0.5, "rolling_friction": 0.1}]}  # fmt: skip


def test_warnings_notes_and_ends_are_logged_also_of_a_quiet_run(tmp_path, caplog):
    with caplog.at_level(logging.INFO, "warpdem"):
        sim, text = twelve_grains.run(twelve_grains.scene(**LOUD), tmp_path, quiet=True)
    assert text == ""
    warned = [record.getMessage() for record in caplog.records if record.levelno == logging.WARNING]
    assert any("pairs[0].restitution = 0.01" in message for message in warned)
    told = [record.getMessage() for record in caplog.records if record.levelno == logging.INFO]
    assert f"done at t = 0.006 s, results in {tmp_path}" in told
    assert any("12 grains at t = 0 s (step 0) on cpu> with a time step of 1e-05 s" in message for message in told)


def test_what_guards_notice_is_logged_once(caplog):
    scene = twelve_grains.scene(engine={"max_overlap": 1e-6, "guards": "record"})
    sim = Simulation(scene, device="cpu", threads=1)
    with caplog.at_level(logging.WARNING, "warpdem"):
        sim.step(600)
    said = [record.getMessage() for record in caplog.records if record.name == "warpdem"]
    assert said == [f"{guard}: {message}" for guard, message in sim.noticed.items()] and said


def test_a_program_that_does_not_listen_hears_nothing():
    code = "import warpdem.core.log as log; log.log.warning('heard'); import logging; assert not logging.root.handlers"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout == done.stderr == ""


def test_what_a_program_holds_is_shown_in_a_line():
    scene = twelve_grains.scene()
    sim = Simulation(scene, device="cpu", threads=1)
    sim.step(300)
    assert repr(scene) == f"<Scene 'twelve grains' of {scene.source}: materials glass; walls floor; 0.006 s>"
    assert repr(sim.particles) == "<Particles: 12 grains at t = 0.003 s>"
    contacts = sim.contacts()
    walls = int((contacts.j < 0).sum())
    assert repr(contacts).startswith(f"<Contacts: {len(contacts.i) - walls} of two grains, {walls} with walls; Deepest")
    load = sim.wall_loads()["floor"]
    assert repr(load).startswith("<WallLoad: force (") and f"power {load.power:.4g} W" in repr(load)
    assert "\n" not in repr(scene) + repr(sim.history) + repr(sim.particles) + repr(contacts) + repr(load)
