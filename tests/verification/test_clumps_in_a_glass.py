"""An hourglass of clumps seen in its own axes and from the laboratory: what runs through the neck when, by perturbed twins."""

from pathlib import Path

import numpy as np
import pytest

import warpdem

MESH = Path(__file__).parents[2] / "scenes" / "meshes" / "hourglass.stl"
TURN = {
    "axis": [0, 1, 0],
    "schedule": [
        {"until": 0.1, "rate": [0, "30 rpm"]}, {"until": 0.95, "rate": "30 rpm"}, {"until": 1.15, "rate": ["30 rpm", 0]},
        {"rate": 0},
    ],
}  # fmt: skip
END, EVERY, TWINS = 2.2, 0.01, 3
NUDGE = 1e-9  # of a radius: as of ``warpdem compare``
FRACTIONS = 0.25, 0.5, 0.75


def scene(grains: dict, **more) -> warpdem.Scene:
    """Dumbbells in a glass that is turned over in a second."""
    spheres = [{"centre": [0, 0, z], "radius": "26 mm"} for z in ("-15 mm", "15 mm")]
    wall = {"name": "glass", "material": "grain", "mesh": str(MESH), "scale": 0.06}
    return warpdem.Scene.model_validate({
        "gravity": [0, 0, -9.81], "materials": {"grain": {"density": 2653, "young_modulus": "0.5 GPa", "poisson_ratio": 0.3}},
        "pairs": [{"materials": ["grain", "grain"], "restitution": 0.1, "friction": 0.5}],
        "clumps": {"dumbbell": {"spheres": spheres}}, "grains": [{"material": "grain", "clump": "dumbbell", **grains}],
        "time": {"end": END, "max_speed": "6 m/s"}, "output": {"formats": []},
        "walls": [wall | ({"motion": TURN} if "frame" not in more else {})], **more,
    })  # fmt: skip


def filled() -> dict:
    """Where 300 dumbbells are that fill a part of the lower bulb."""
    region = {"min": [-2, -2, -3], "max": [2, 2, 0]}
    fill = {"wall": "glass", "region": region, "count": 300, "seed": 3}
    sim = warpdem.Simulation(scene({"fill": fill}, frame=TURN), device="cpu", threads=1)
    return {"positions": sim.clumps.position, "orientations": sim.clumps.orientation}


def run(start: dict, twin: int, **more) -> tuple[np.ndarray, np.ndarray]:
    """Times at which the fractions have passed the neck [s], and the places in the laboratory at 0.05 s."""
    shift = np.random.default_rng(twin).normal(0, NUDGE * 0.026 * (twin > 0), start["positions"].shape)
    sim = warpdem.Simulation(scene(start | {"positions": start["positions"] + shift}, **more), device="cpu", threads=1)
    sim.run(until=0.05)
    early = sim.particles.position_lab
    times, below = [], []
    for time in np.arange(0.9, END + 1e-9, EVERY):
        sim.run(until=time)
        times.append(sim.time)
        below.append((sim.particles.position_lab[:, 2] < 0.0).mean())
    below_now = np.maximum.accumulate(below)
    return np.array([np.interp(f, below_now, times) for f in FRACTIONS]), early


@pytest.mark.slow
def test_frame_and_laboratory_agree_on_an_hourglass_of_clumps():
    start = filled()
    seen, early_seen = zip(*(run(start, twin, frame=TURN) for twin in range(TWINS)), strict=True)
    still, early_still = zip(*(run(start, twin) for twin in range(TWINS)), strict=True)
    np.testing.assert_allclose(early_seen[0], early_still[0], rtol=0, atol=1e-7)
    scatter = np.sqrt(np.var(seen, axis=0, ddof=1) / TWINS + np.var(still, axis=0, ddof=1) / TWINS)
    away = np.abs(np.mean(seen, axis=0) - np.mean(still, axis=0))
    print("frame", np.round(seen, 4).tolist(), "laboratory", np.round(still, 4).tolist(), "away/error", away / scatter)
    assert (away < 3.0 * scatter + 2e-3).all(), (seen, still)
    assert (np.mean(seen, axis=0) > 1.0).all() and (np.diff(np.mean(seen, axis=0)) > 0.01).all()
