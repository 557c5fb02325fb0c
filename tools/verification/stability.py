"""Measure and draw stability limits against their rule, and errors of the energy against the step.

    python tools/verification/stability.py [--out FOLDER]      stability.png and stability.json, to tests/results; two minutes

The scenes are those of the tests (``tests/helpers/stability_scenes.py``).
"""

import argparse
import io
import json
import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[2] / "tests" / "helpers"))

import matplotlib

matplotlib.use("Agg")  # no screen
import numpy as np
from matplotlib import pyplot as plt
from PIL import Image

import stability_scenes as scenes

RESTITUTIONS = (1.0, 0.9, 0.7, 0.5, 0.3, 0.1)
LAWS = (("hooke", 0.0), ("hooke", 0.1), ("hooke", 2.0 / 7.0), ("hooke", 1.0), ("hertz", 1.0))
NAMES = {"packing": "packing, 6 contacts per grain", "pressed": "one contact of two grains"}
GAS_STEPS = (8.0, 16.0, 32.0, 64.0)


def limits() -> list[dict]:
    """Rule and measurement [s] of each packing and contact."""
    out = []
    for make, key in ((scenes.packing, "packed"), (scenes.pressed, "stable")):
        for normal, ratio in LAWS:
            for restitution in RESTITUTIONS:
                rule = getattr(make(normal, ratio, restitution, 1e-6).limits, key)
                found = scenes.measured_limit(make, normal, ratio, restitution, rule)
                out.append({"of": make.__name__, "normal": normal, "ratio": ratio, "restitution": restitution,
                            "rule_s": rule, "measured_s": found})  # fmt: skip
                print(f"{make.__name__}, {normal} {ratio:.2g}, e = {restitution}: measured/rule {found / rule:.3f}", flush=True)
    return out


def draw(found: list[dict], gas: dict[float, float], path: Path) -> None:
    """Write the picture."""
    figure, axes = plt.subplots(1, 3, figsize=(12, 4), layout="constrained")
    for ax, (name, title) in zip(axes, NAMES.items(), strict=False):
        for k, (normal, ratio) in enumerate(LAWS):
            rows = [r for r in found if (r["of"], r["normal"], r["ratio"]) == (name, normal, ratio)]
            rate = 2.0 / max(r["rule_s"] for r in rows)  # the rule of e = 1 is 2/w
            e = [r["restitution"] for r in rows]
            word = "no friction" if ratio == 0.0 else "hertz, friction" if normal == "hertz" else f"k_t = {ratio:.2g} k_n"
            ax.plot(e, [rate * r["rule_s"] for r in rows], "-", color=f"C{k}")
            ax.plot(e, [rate * r["measured_s"] for r in rows], "o", color=f"C{k}", label=word)
        ax.set(title=title, xlabel="restitution", ylabel="largest stable step x undamped rate w", ylim=(0, 2.2))
        ax.legend(fontsize=8, title="points: measured; lines: rule", title_fontsize=8)
    steps = np.array(list(gas))
    axes[2].loglog(steps, list(gas.values()), "o-", label="measured")
    axes[2].loglog(steps, gas[GAS_STEPS[0]] * (GAS_STEPS[0] / steps) ** 2.5, ":k", label="order 2.5")
    axes[2].set(title="elastic gas", xlabel="steps per quickest contact", ylabel="rms change of energy in 6 contact times")
    axes[2].legend(fontsize=8)
    raw = io.BytesIO()
    figure.savefig(raw, format="png", dpi=75)
    plt.close(figure)
    Image.open(raw).convert("RGB").quantize(64, dither=Image.Dither.NONE).save(path, optimize=True)


def main() -> None:
    """Entry point."""
    parser = argparse.ArgumentParser(description="Measure and draw stability limits and errors of the energy.")
    parser.add_argument("--out", type=Path, default=Path(__file__).resolve().parents[2] / "tests" / "results")
    options = parser.parse_args()
    options.out.mkdir(parents=True, exist_ok=True)
    gas = {n: float(np.sqrt(np.mean(scenes.energy_errors(n) ** 2))) for n in GAS_STEPS}
    found = limits()
    (options.out / "stability.json").write_text(json.dumps({"limits": found, "gas": gas}, indent=1) + "\n")
    draw(found, gas, options.out / "stability.png")


if __name__ == "__main__":
    main()
