"""The force of ``normal = "jkr"`` beside that of LAMMPS (``pair_style granular``, model ``jkr``) as two grains are drawn apart.

    python tools/verification/jkr_lammps.py [LAMMPS]      # its binary, lmp without one

Two spheres of 1 mm are drawn apart at an even speed from an overlap of 10 um, by LAMMPS; at each of its places the kernel gives
its own force. It prints the largest difference over the pull-off force, and where each contact ends. LAMMPS's surface energy
is half of the work of adhesion. Last result (LAMMPS 29 Sep 2021): see ``tests/README.md``.
"""

import argparse
import re
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np
from warpdem.kernels.normal import jkr, jkr_fixed_load

sys.path.insert(0, str(Path(__file__).resolve().parents[2] / "tests" / "helpers"))
from adhesion import DENSITY, ENERGY, MASS, POISSON, RADIUS, REDUCED, YOUNG
from law_probe import Contacts

START, SPEED, STEP, STEPS = 1e-5, 0.5, 4e-9, 5500
"""Overlap at the start [m], speed at which they are drawn apart [m/s], and steps [s]."""
INPUT = """
units si
atom_style sphere
atom_modify sort 0 0 map array
boundary f f f
newton off
comm_modify vel yes
region box block -0.02 0.02 -0.02 0.02 -0.02 0.02
create_box 1 box
create_atoms 1 single 0 0 0
create_atoms 1 single {distance!r} 0 0
set group all diameter {diameter!r} density {density!r}
pair_style granular
pair_coeff * * jkr {young!r} 0 {poisson!r} {gamma!r} tangential linear_nohistory 0.0 0.0 damping velocity
neighbor 3e-4 bin
neigh_modify delay 0 every 1 check yes
group one id 1
group two id 2
timestep {step!r}
fix 1 one move linear 0 0 0
fix 2 two move linear {speed!r} 0 0
variable apart equal x[2]-x[1]
variable pull equal fx[2]
thermo_style custom step v_apart v_pull
thermo_modify norm no format float %.17g
thermo 10
run {steps}
"""


def drawn_apart(binary: str) -> np.ndarray:
    """Overlap [m] and force [N] as LAMMPS has them, shape (n, 2)."""
    text = INPUT.format(
        distance=2.0 * RADIUS - START, diameter=2.0 * RADIUS, density=DENSITY, young=YOUNG, poisson=POISSON, gamma=0.5 * ENERGY,
        step=STEP, speed=SPEED, steps=STEPS,
    )  # fmt: skip
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "in.jkr"
        path.write_text(text)
        done = subprocess.run(
            [binary, "-in", str(path), "-log", "none"], cwd=folder, capture_output=True, text=True, timeout=300,
            check=False,  # the contact that ends makes some versions stop: what came before it counts
        )  # fmt: skip
    rows = re.findall(r"^\s*\d+\s+(\S+)\s+(\S+)\s*$", done.stdout, re.MULTILINE)
    found = np.array([(2.0 * RADIUS - float(apart), float(pull)) for apart, pull in rows])
    if len(found) < STEPS // 20:
        sys.exit(f"LAMMPS ended early:\n{done.stdout[-2000:]}{done.stderr[-2000:]}")
    return found


def main() -> None:
    """Run LAMMPS and compare."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("binary", nargs="?", default="lmp")
    overlap, theirs = drawn_apart(parser.parse_args().binary).T

    class Grain:
        young_modulus, poisson_ratio = YOUNG, POISSON

    class Pair:
        surface_energy, restitution = ENERGY, 1.0

    pull = 1.5 * np.pi * ENERGY * REDUCED
    for law in (jkr, jkr_fixed_load):
        made = Contacts(law, jkr.coefficients(Grain, Grain, Pair), REDUCED, MASS)
        pull_off = made.constants[-1]
        ours, history = np.zeros(len(overlap)), np.array([[pull_off]])
        for k, d in enumerate(overlap):  # one step after the other: the contact is remembered
            found = made.force([d], [overlap[max(k - 1, 0)]], history=history)
            history = found["history"]
            ours[k] = found["force"][0] * (history[0, 0] > 0.0)
        both = (ours != 0.0) & (theirs != 0.0)
        ends = [overlap[np.flatnonzero(force)[-1]] / pull_off for force in (ours, theirs)]
        name = law.__name__.rsplit(".", 1)[1]
        print(f"{name}: {both.sum()} places, largest difference {np.abs(ours - theirs)[both].max() / pull:.2g} F_c; "
              f"last held at {ends[0]:.3f} d_c, LAMMPS at {ends[1]:.3f} d_c")  # fmt: skip


if __name__ == "__main__":
    main()
