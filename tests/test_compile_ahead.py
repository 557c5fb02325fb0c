"""Kernels compiled by a second process: the right ones, into the run's own cache, and only where that helps."""

import io
import os
import pickle
import subprocess
import sys
import time
from pathlib import Path
from types import SimpleNamespace

import pytest
import warp as wp

from warpdem import Simulation, load_scene
from warpdem.app import compile_ahead
from warpdem.model.compiled import step_kernels

SCENES = Path(__file__).resolve().parents[1] / "scenes"
FEWER = {"hourglass": ["grains.0.fill.count=20"]}


@pytest.mark.parametrize("name", ["two_spheres", "disk", "turning_chute", "hourglass"])
def test_what_is_compiled_ahead_is_what_the_run_needs(name):
    """The main job among them: if its features are no longer guessed right, its first start gets slower without a word."""
    scene = load_scene(SCENES / f"{name}.toml", FEWER.get(name, ()))
    sim = Simulation(scene, device="cpu", threads=1)
    assert compile_ahead.likely_features(scene) == sim.plan
    assert step_kernels(sim.kernels)[0] is sim.kernels.loop.run


def test_spins_of_given_grains_are_seen_before_they_are_placed(make_scene):
    for spins, kernels_have_them in ((None, False), ([[0.0, 0.0, 1.0]], True)):
        guess = compile_ahead.likely_features(make_scene([[0.0, 0.0, 0.0]], step=1e-6, spins=spins))
        assert guess.contact.spins == kernels_have_them


def test_nothing_is_guessed_where_the_scene_does_not_tell(make_scene):
    scene = make_scene([[0.0, 0.0, 0.0]], step=1e-6)
    assert compile_ahead.likely_features(scene) is not None
    assert compile_ahead.likely_features(scene.model_copy(update={"start": "checkpoint.h5"})) is None


@pytest.fixture
def started(monkeypatch):
    """What would be started, in place of starting it."""
    calls = []

    def popen(command, **options):
        pipe = io.BytesIO()
        helper = SimpleNamespace(
            stdin=SimpleNamespace(write=pipe.write, flush=pipe.flush, close=lambda: calls.append("over"))
        )
        helper.wait = lambda: None
        calls.append((command, pipe))
        return helper

    monkeypatch.setattr(compile_ahead.subprocess, "Popen", popen)
    monkeypatch.setattr(compile_ahead, "_has_idle_core", lambda: True)
    return calls


def test_a_second_process_gets_features_and_cache_where_kernels_are_missing(make_scene, started, monkeypatch, tmp_path):
    scene = make_scene([[0.0, 0.0, 0.0]], step=1e-6)
    wp.init()
    monkeypatch.setattr(wp.config, "kernel_cache_dir", str(tmp_path))
    with compile_ahead.compiling_ahead(scene, "cpu"):
        [(command, pipe)] = started
    assert command == [sys.executable, "-P", "-m", "warpdem.app.compile_ahead"]
    assert pickle.loads(pipe.getvalue()) == (compile_ahead.likely_features(scene), str(tmp_path))
    assert started[1:] == ["over"]


def test_no_process_is_started_where_it_would_not_help(make_scene, started, monkeypatch):
    scene = make_scene([[0.0, 0.0, 0.0]], step=1e-6)
    Simulation(scene, device="cpu", threads=1).load_kernels()  # all are there
    with compile_ahead.compiling_ahead(scene, "cpu"):
        assert not started
    monkeypatch.setattr(compile_ahead, "_is_missing", lambda features: True)
    monkeypatch.setattr(compile_ahead, "_has_idle_core", lambda: False)
    with compile_ahead.compiling_ahead(scene, "cpu"):
        assert not started


@pytest.mark.parametrize(("cores", "load", "idle"), [(1, 0.0, False), (2, 0.4, True), (2, 1.9, False), (4, 2.0, True)])
def test_a_core_is_idle_when_the_load_leaves_one(monkeypatch, cores, load, idle):
    monkeypatch.setattr(compile_ahead, "available_threads", lambda: cores)
    monkeypatch.setattr(os, "getloadavg", lambda: (load, 0.0, 0.0), raising=False)
    assert compile_ahead._has_idle_core() == idle


def test_a_process_that_cannot_be_started_stops_nobody(make_scene, monkeypatch):
    def popen(*arguments, **options):
        raise OSError("no memory")

    monkeypatch.setattr(compile_ahead.subprocess, "Popen", popen)
    monkeypatch.setattr(compile_ahead, "_has_idle_core", lambda: True)
    monkeypatch.setattr(compile_ahead, "_is_missing", lambda features: True)
    with compile_ahead.compiling_ahead(make_scene([[0.0, 0.0, 0.0]], step=1e-6), "cpu"):
        pass


@pytest.fixture
def asked(make_scene, tmp_path):
    """What the second process reads."""
    features = compile_ahead.likely_features(make_scene([[0.0, 0.0, 0.0]], step=1e-6))
    return features, pickle.dumps((features, str(tmp_path)))


def test_second_process_ends_after_the_kernel_it_is_at_when_the_first_needs_it_no_more(asked, monkeypatch):
    wp.init()
    monkeypatch.setattr(wp.config, "kernel_cache_dir", wp.config.kernel_cache_dir)  # put back afterwards
    reading, writing = os.pipe()
    os.write(writing, asked[1])
    monkeypatch.setattr(sys, "stdin", SimpleNamespace(buffer=os.fdopen(reading, "rb")))
    loaded = []

    def load_module(module, device):
        loaded.append(module)
        if len(loaded) == 2:
            os.close(writing)
            time.sleep(0.5)

    monkeypatch.setattr(wp, "load_module", load_module)
    compile_ahead.main()
    kernels = step_kernels(compile_ahead.compile_kernels(asked[0]))
    assert loaded == [kernel.module for kernel in kernels[:2]]


@pytest.mark.slow
def test_second_process_fills_the_cache(asked, tmp_path):
    done = subprocess.Popen([sys.executable, "-m", "warpdem.app.compile_ahead"], stdin=subprocess.PIPE)
    done.stdin.write(asked[1])
    done.stdin.flush()
    assert done.wait(300) == 0
    done.stdin.close()
    there = {path.name for path in tmp_path.iterdir()}
    assert there == {k.module.get_module_identifier(1) for k in step_kernels(compile_ahead.compile_kernels(asked[0]))}
