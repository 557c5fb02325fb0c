"""Draw what the tests of impacts measure: oblique impacts over the angle, restitution and energy.

    python tools/verification/impacts.py                 to tests/results/impacts.png

The impacts and the published values are those of the tests (``tests/helpers/chung_ooi.py``).
"""

import argparse
import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[2] / "tests" / "helpers"))

import numpy as np

import chung_ooi
from chung_ooi import OXIDE, SPEED, oblique, rebound, wall_impacts
from warpdem import Simulation

LAWS = {"mindlin": "C0", "mindlin_displacement": "C1"}
ANGLES = np.arange(1.0, 90.0, 1.0)


def after(scene, end: float) -> Simulation:
    """The impacts of ``scene``, over at ``end`` [s]."""
    sim = Simulation(scene, device="cpu", threads=1)
    sim.run(until=end)
    return sim


def angles(law: str) -> np.ndarray:
    """Ratio of tangential speeds, spin [rad/s] and rebound angle [deg] by angle, shape (89, 3)."""
    speed, spin, angle = rebound(after(*oblique(OXIDE, law, ANGLES)))
    return np.stack([speed / (SPEED * np.sin(np.radians(ANGLES))), spin, angle], axis=1)


def restitutions(asked: np.ndarray, steps: int) -> np.ndarray:
    """Mean of e obtained less e asked over 16 phases of the onset and its spread, shape (2, n)."""
    phase = np.tile((np.arange(16) + 0.5) / 16, len(asked))
    e = np.repeat(asked, 16)
    scene, end = wall_impacts(OXIDE, np.full(len(e), SPEED), 0.0, "mindlin", restitution=e, steps=steps, phase=phase)
    error = (after(scene, end).particles.velocity[:, 2] / SPEED - e).reshape(-1, 16)
    return np.stack([error.mean(axis=1), np.abs(error).max(axis=1)])


def energy_gain(law: str) -> np.ndarray:
    """Energy after over energy before, less 1 [%], of undamped impacts at friction 10, by angle."""
    a = np.radians(ANGLES)
    ways = SPEED * np.cos(a), SPEED * np.sin(a)
    p = after(*wall_impacts(OXIDE, *ways, law, restitution=np.ones(len(a)), friction=10.0, steps=400)).particles
    energy = p.mass * (p.velocity**2).sum(axis=1) + p.inertia * (p.spin**2).sum(axis=1)
    return 100.0 * (energy / (p.mass * SPEED**2) - 1.0)


def main() -> None:
    """Entry point."""
    parser = argparse.ArgumentParser(description="Draw what the tests of impacts measure.")
    parser.add_argument("--out", type=Path, default=Path(__file__).resolve().parents[2] / "tests" / "results" / "impacts.png")
    out = parser.parse_args().out
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt
    from PIL import Image

    figure, axes = plt.subplots(2, 3, figsize=(12, 7))
    paper = chung_ooi.PAPER_OXIDE
    for law, colour in LAWS.items():
        found = angles(law)
        for column, ax in enumerate(axes[0]):
            ax.plot(ANGLES, found[:, column], color=colour, label=law)
        axes[1, 2].plot(ANGLES, energy_gain(law), color=colour, label=law)
    for column, ax in enumerate(axes[0]):
        ax.plot(paper[:, 0], paper[:, column + 1], "k+", label="Chung and Ooi, DEM")
    axes[0, 0].plot(*chung_ooi.MEASURED_RATIO.T, "o", color="grey", fillstyle="none", label="measured (Kharaz et al.)")
    axes[0, 1].plot(*chung_ooi.MEASURED_SPIN.T, "o", color="grey", fillstyle="none", label="measured (Kharaz et al.)")
    names = "tangential speed after / before [-]", "spin [rad/s]", "rebound angle of the contact point [deg]"
    for ax, name in zip(axes[0], names, strict=True):
        ax.set(xlabel="angle of impact [deg]", ylabel=name)
    asked = np.array([0.05, 0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9, 0.95, 1.0])
    axes[1, 0].plot([0, 1], [0, 1], color="lightgrey")
    for steps, colour in ((28, "C3"), (100, "C0"), (400, "C2")):
        mean, worst = restitutions(asked, steps)
        axes[1, 0].plot(asked, asked + mean, ".", color=colour, label=f"{steps} steps per contact")
        axes[1, 1].plot(asked, worst, ".-", color=colour, label=f"{steps} steps per contact")
    axes[1, 0].set(xlabel="restitution asked [-]", ylabel="restitution got [-], mean of 16 phases")
    axes[1, 1].set(xlabel="restitution asked [-]", ylabel="worst error of 16 phases [-]", yscale="log")
    axes[1, 2].axhline(0.0, color="lightgrey")
    axes[1, 2].set(xlabel="angle of impact [deg]", ylabel="energy gained [%], e = 1, friction 10", ylim=(-22, 2))
    for ax in axes.flat:
        ax.grid(alpha=0.3)
        ax.legend(fontsize=7)
    figure.tight_layout()
    out.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(out, dpi=75)
    with Image.open(out) as picture:
        small = picture.convert("RGB").quantize(32)
    small.save(out, optimize=True)
    print(f"{out}: {out.stat().st_size // 1000} kB")


if __name__ == "__main__":
    main()
