"""Cohesive laws and twisting beside LIGGGHTS and LAMMPS: the same contacts, force by force.

    python tools/verification/sticky_peers.py            a table; exit code 1 if a force differs by more than 1e-10 of it

LIGGGHTS-PUBLIC 3.8 (``liggghts``) has SJKR, between grains and at walls; LAMMPS 2021 (``lmp``, pair style granular) has DMT,
JKR and Marshall's twisting. A peer that is not on the PATH is left out, and said so. The surface energy of LAMMPS is half the
work of adhesion. Spins differ by what the torque does in one step: here the twisting spring is a step old when a run begins.
Where a JKR contact ends is another matter: LAMMPS ends it at the largest pull (``jkr_fixed_load``).
"""

import math
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np

from warpdem import Scene, Simulation

MATERIAL = {"density": 2500.0, "young_modulus": 1.0e7, "poisson_ratio": 0.3}
RADII = ((1.0e-3, 1.0e-3), (1.0e-3, 0.4e-3))
OVERLAPS = (1.0e-7, 1.0e-6, 5.0e-6, 2.0e-5)
W, COHESION = 0.1, 1.0e5  # [J/m2], [J/m3]
SAME = 1.0e-10
TWISTED = 9.0e-4, 5.0e-3  # times [s] at which spins are compared


def deck(lines: str, command: str, dump: str) -> np.ndarray:
    """Run a peer; the numbers of the last frame of its dump ``dump``, sorted by the first."""
    with tempfile.TemporaryDirectory() as folder:
        Path(folder, "in").write_text(lines)
        done = subprocess.run([command, "-in", "in"], cwd=folder, capture_output=True, text=True, timeout=120, check=False)
        if done.returncode or not Path(folder, dump).exists():
            raise RuntimeError(f"{command} fails:\n{done.stdout[-1000:]}{done.stderr[-1000:]}")
        text = Path(folder, dump).read_text().split("ITEM: ATOMS")[-1].splitlines()[1:]
    rows = np.array([[float(x) for x in line.split()] for line in text])
    return rows[np.argsort(rows[:, 0])]


def liggghts(radii: tuple[float, float], overlap: float, wall: bool) -> float:
    """Force of SJKR on the first grain away from its partner [N]."""
    a, b = radii
    grains = f"create_atoms 1 single 0 0 {a - overlap:.17g} units box\n"
    plane = "fix w all wall/gran model hertz tangential off cohesion sjkr primitive type 1 zplane 0.0\n"
    if not wall:
        plane, grains = "", "create_atoms 1 single 0 0 0 units box\n"
        grains += f"create_atoms 1 single {a + b - overlap:.17g} 0 0 units box\n"
    sizes = "".join(f"set atom {k} diameter {2 * r:.17g} density 2500\n" for k, r in ((1, a), (2, b))[: 1 if wall else 2])
    rows = deck(
        "units si\natom_style granular\natom_modify map array\nboundary f f f\nnewton off\ncommunicate single vel yes\n"
        "region r block -0.02 0.02 -0.02 0.02 -0.02 0.02 units box\ncreate_box 1 r\nneighbor 0.0005 bin\n"
        "neigh_modify delay 0\nfix m1 all property/global youngsModulus peratomtype 1e7\n"
        "fix m2 all property/global poissonsRatio peratomtype 0.3\n"
        "fix m3 all property/global coefficientRestitution peratomtypepair 1 0.9\n"
        "fix m4 all property/global coefficientFriction peratomtypepair 1 0.0\n"
        f"fix m5 all property/global cohesionEnergyDensity peratomtypepair 1 {COHESION:.17g}\n"
        f"pair_style gran model hertz tangential off cohesion sjkr\npair_coeff * *\n{grains}{sizes}{plane}"
        "timestep 1e-12\nfix i all nve/sphere\ndump d all custom 1 out id fx fz\n"
        'dump_modify d format "%d %.17g %.17g"\nrun 0\n',
        "liggghts", "out",
    )  # fmt: skip
    return float(rows[0, 2] if wall else -rows[0, 1])


LAMMPS = (
    "units si\natom_style sphere\nboundary f f f\nnewton off\ncomm_modify vel yes\n"
    "region r block -0.02 0.02 -0.02 0.02 -0.02 0.02\ncreate_box 1 r\npair_style granular\n"
)


def lammps(law: str, radii: tuple[float, float], overlap: float) -> float:
    """Force of ``dmt`` or ``jkr`` on the first grain away from its partner [N]."""
    a, b = radii
    rows = deck(
        f"{LAMMPS}pair_coeff * * {law} 1e7 0.0 0.3 {0.5 * W:.17g} tangential mindlin NULL 0.0 0.0 damping velocity\n"
        f"create_atoms 1 single 0 0 0\ncreate_atoms 1 single {a + b - overlap:.17g} 0 0\nset group all density 2500\n"
        f"set atom 1 diameter {2 * a:.17g}\nset atom 2 diameter {2 * b:.17g}\ntimestep 1e-12\nfix i all nve/sphere\n"
        'dump d all custom 1 out id fx\ndump_modify d format line "%d %.17g"\nrun 0\n',
        "lmp", "out",
    )  # fmt: skip
    return float(-rows[0, 1])


def ours(law: str, keys: dict, radii: tuple[float, float], overlap: float, wall: bool = False) -> float:
    """Force of a normal law on the first grain away from its partner [N]."""
    a, b = radii
    places = [[0, 0, a - overlap]] if wall else [[0, 0, 0], [a + b - overlap, 0, 0]]
    plane = {"name": "plane", "material": "g", "plane": {"point": [0, 0, 0], "normal": [0, 0, 1]}}
    scene = Scene.model_validate({
        "gravity": [0, 0, 0],
        "materials": {"g": MATERIAL},
        "contact": {"normal": law, "tangential": "none"},
        "pairs": [{"materials": ["g", "g"], "restitution": 1.0} | keys],
        "grains": [{"material": "g", "radii": list(radii)[: len(places)], "positions": places}],
        "walls": [plane] if wall else [],
        "time": {"end": 1.0, "step": 1e-9, "max_speed": 1e-3},
    })  # fmt: skip
    c = Simulation(scene, device="cpu", threads=1).contacts()
    return float(c.force[0] @ c.normal[0])


def twisted(step: float = 2e-7) -> tuple[list[float], list[float]]:
    """Relative spins [rad/s] of two grains pressed with 1 mN and counter-spun at 50 rad/s: of LAMMPS, and of this engine."""
    radius, pressed = 1.0e-3, 1.0e-3
    stiffness = 4.0 / 3.0 * 1.0e7 / (2.0 * 0.91) * math.sqrt(0.5 * radius)
    apart = radius - 0.5 * (pressed / stiffness) ** (2.0 / 3.0)
    theirs = []
    for time in TWISTED:
        rows = deck(
            f"{LAMMPS}pair_coeff * * hertz/material 1e7 0.0 0.3 tangential mindlin NULL 0.0 0.5 twisting marshall "
            f"damping velocity\ncreate_atoms 1 single {-apart:.17g} 0 0\ncreate_atoms 1 single {apart:.17g} 0 0\n"
            f"set group all diameter {2 * radius:.17g}\nset group all density 2500\nset atom 1 omega 25 0 0\n"
            f"set atom 2 omega -25 0 0\ngroup one id 1\ngroup two id 2\nfix f1 one addforce {pressed} 0 0\n"
            f"fix f2 two addforce {-pressed} 0 0\ntimestep {step}\nfix i all nve/sphere\n"
            f"dump d all custom {round(time / step)} out id omegax\n"
            f'dump_modify d format line "%d %.17g"\nrun {round(time / step)}\n',
            "lmp", "out",
        )  # fmt: skip
        theirs.append(float(rows[0, 1] - rows[1, 1]))
    scene = Scene.model_validate({
        "gravity": [0, 0, 0],
        "materials": {"g": MATERIAL},
        "contact": {"twisting": "marshall"},
        "pairs": [{"materials": ["g", "g"], "restitution": 1.0, "friction": 0.5}],
        "grains": [{"material": "g", "radius": radius, "positions": [[-apart, 0, 0], [apart, 0, 0]],
                    "spins": [[25, 0, 0], [-25, 0, 0]]}],
        "fields": [{"model": "harmonic", "parameters": {"stiffness": pressed / apart}}],
        "time": {"end": 1.0, "step": step, "max_speed": 1e-3},
    })  # fmt: skip
    sim, here = Simulation(scene, device="cpu", threads=1), []
    for time in TWISTED:
        sim.run(until=time)
        here.append(float(sim.particles.spin[0, 0] - sim.particles.spin[1, 0]))
    return theirs, here


def main() -> int:
    """Entry point; the exit code."""
    worst = 0.0
    print("law    partner      overlap [m]   peer [N]                 here [N]                 difference over it")

    def row(law: str, partner: str, overlap: float, peer: float, here: float) -> None:
        nonlocal worst
        off = abs(here - peer) / abs(peer)
        worst = max(worst, off)
        print(f"{law:6} {partner:12} {overlap:.1e}       {peer:+.15e}   {here:+.15e}   {off:.1e}")

    if shutil.which("liggghts"):
        for overlap in OVERLAPS:
            for radii in RADII:
                given = {"cohesion_energy_density": COHESION}
                name = f"{radii[0] * 1e3:g}, {radii[1] * 1e3:g} mm"
                row("sjkr", name, overlap, liggghts(radii, overlap, False), ours("sjkr", given, radii, overlap))
            row("sjkr", "wall", overlap, liggghts(RADII[0], overlap, True), ours("sjkr", given, RADII[0], overlap, True))
    else:
        print("liggghts is not on the PATH: SJKR is left out")
    if shutil.which("lmp"):
        for law in ("dmt", "jkr"):
            for overlap in OVERLAPS:
                for radii in RADII:
                    name = f"{radii[0] * 1e3:g}, {radii[1] * 1e3:g} mm"
                    row(law, name, overlap, lammps(law, radii, overlap), ours(law, {"surface_energy": W}, radii, overlap))
        theirs, here = twisted()
        for time, peer, mine in zip(TWISTED, theirs, here, strict=True):
            print(f"twisting marshall: relative spin after {time:g} s {peer:.7f} rad/s, here {mine:.7f}, {mine - peer:+.1e}")
    else:
        print("lmp is not on the PATH: DMT, JKR and twisting are left out")
    print(f"largest difference of a force: {worst:.1e} of it")
    return int(worst > SAME)


if __name__ == "__main__":
    sys.exit(main())
