"""Scenes that need more memory than there is: refused with both numbers, within the limits of containers and shells."""

from pathlib import Path

import pytest

from hostile import GRAIN, HEAD, refused
from warpdem import SceneError, Simulation, load_scene
from warpdem.core import memory
from warpdem.model import needs

pytestmark = pytest.mark.filterwarnings("error", "ignore:Cyclopts application invoked without tokens")


def test_the_limit_of_a_container_counts(tmp_path, monkeypatch):
    """Of both versions of control groups, wherever in the tree the limit is; cached files count as free."""
    (tmp_path / "a" / "b").mkdir(parents=True)
    monkeypatch.setattr(memory, "CGROUPS", tmp_path)
    monkeypatch.setattr(memory, "Path", lambda name: proc if name == "/proc/self/cgroup" else Path(name))
    proc = tmp_path / "cgroup"
    proc.write_text("0::/a/b\n")
    for folder, most in ((tmp_path / "a", "900000000"), (tmp_path / "a" / "b", "max")):
        (folder / "memory.max").write_text(most)
        (folder / "memory.current").write_text("600000000\n")
        (folder / "memory.stat").write_text("anon 1\ninactive_file 100000000\n")
    assert memory.available() == 400_000_000
    proc.write_text("5:cpu,memory:/docker/x\n")
    (tmp_path / "memory").mkdir()
    (tmp_path / "memory" / "memory.limit_in_bytes").write_text("500000000")
    (tmp_path / "memory" / "memory.usage_in_bytes").write_text("200000000")
    (tmp_path / "memory" / "memory.stat").write_text("total_inactive_file 0\n")
    assert memory.available() == 300_000_000


def test_a_limit_of_the_shell_counts():
    resource = pytest.importorskip("resource")
    before = resource.getrlimit(resource.RLIMIT_DATA)
    used = int(Path("/proc/self/status").read_text().split("VmData:")[1].split()[0]) * 1024
    resource.setrlimit(resource.RLIMIT_DATA, (used + 300_000_000, before[1]))
    try:
        assert memory.available() <= 300_000_000
    finally:
        resource.setrlimit(resource.RLIMIT_DATA, before)


FILL = 'grains = [{{ material = "g", fill = {{ box = {{ min = [0, 0, 0], max = [{0}, {0}, {0}] }}, {1}, diameter = "{2}" }} }}]'
GRID = "measures.grid = {{ box = {{ min = [0, 0, 0], max = [1, 1, 1] }}, cell = {} }}"
BEYOND = {
    "count": (FILL.format(100, "count = 1000000000000", "5 mm"), ["grains[0].fill", "1e+12 grains", "3.5e+05 GB", "available"]),
    "small grains": (FILL.format(1, "count = 1000000000", "0.5 mm"), ["grains[0].fill", "1e+09 grains", "350 GB", "available"]),
    "count in a small box": (FILL.format(0.01, "count = 1000000000000", "5 mm"), ["grains[0].fill", "solid fraction", "0.74"]),
    "mass": (FILL.format(1000, 'mass = "1e9 kg"', "0.1 mm"), ["grains[0].fill", "GB", "available"]),
    "solid fraction": (FILL.format(100, "solid_fraction = 0.4", "0.1 mm"), ["grains[0].fill", "GB", "available"]),
    "grid": (GRAIN + GRID.format(1e-5), ["measures.grid.cell = 1e-05 m", "1e+15 points", "GB", "take a larger cell"]),
    "finest grid": (GRAIN + GRID.format(1e-12), ["measures.grid.cell", "1e+36 points", "available"]),
    "wide kernel": (GRAIN + GRID.format("0.1, width = 1000"), ["measures.grid.width = 1000 m", "1e+04 cells", "at most 50"]),
}


@pytest.mark.parametrize("case", BEYOND)
def test_more_than_the_memory_holds_is_refused_with_both_numbers(tmp_path, case):
    text, words = BEYOND[case]
    said = refused(tmp_path, HEAD + text)
    for word in words:
        assert word in said, said


def test_grains_that_fit_are_not_refused_and_told_from_eight_tenths(tmp_path, monkeypatch):
    from warpdem.app import scene_warnings

    (tmp_path / "scene.toml").write_text(HEAD + FILL.format(0.05, "count = 300", "2 mm"))
    scene = load_scene(tmp_path / "scene.toml")
    sim = Simulation(scene, device="cpu", threads=1)
    each = sim.plan.bytes_per_grain
    needed = needs.memory_bytes(scene, each, 300)
    for share, warned in ((0.7, False), (0.9, True)):
        monkeypatch.setattr(memory, "available", lambda share=share: needed / share - 300 * each)
        assert any("of memory" in text for text in scene_warnings.warnings(sim)) == warned
    monkeypatch.setattr(memory, "available", lambda: 300 * each)
    Simulation(scene, device="cpu", threads=1)
    monkeypatch.setattr(memory, "available", lambda: 300 * each - 1)
    with pytest.raises(SceneError, match=f"300 grains need .* kB of memory, {each} B each, and .* kB are available"):
        Simulation(scene, device="cpu", threads=1)
