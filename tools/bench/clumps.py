"""What clumps cost over free spheres: `python tools/bench/clumps.py --help`; how to read it: README.md.

A settled bed of clumps of three spheres, and the same spheres without clumps, at the same places: the template leaves gaps
between its spheres, so that spheres of one clump do not touch as free ones either and both beds have the same contacts. They
have the same lists too, whose width is held: of spheres that lie still it would stay what it is, of clumps it would shrink.
Their windows take turns, processor time counts on one thread, and the least of each. The phases of one step of each are timed
alone as well.
Beside LIGGGHTS, which packs and settles a bed of the same clumps on the same ground; what it tells is wall time, so the
machine must be quiet.
"""

import json
import math
import sys
import time
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))  # tools/

import numpy as np
from cyclopts import App, Parameter
from rich.box import SIMPLE
from rich.console import Console
from rich.table import Table

import warpdem
from bench import liggghts
from bench.states import MATERIAL
from bench.walls import phases
from bench.window import OtherLoad, commit, machine

RADIUS = 0.225e-3  # of each sphere [m]
GAP = 6e-5  # between two spheres of a clump [m]: wider than the skin, so that they are no neighbors
STEP, SKIN = 1e-6, 5e-5  # [s], [m]
FRACTION = 0.30  # of the spheres when the bed is filled [-]
SETTLING = 2e-6  # step in which the bed settles [s]
HEAVY = 1e6  # density of the free spheres over that of the clumps: they start at rest and stay, and keep their contacts
LAW = "mindlin_displacement"


def template() -> np.ndarray:
    """Centres of the spheres of a clump, the corners of a triangle [m], shape (3, 3)."""
    angle = 2.0 * np.pi / 3.0 * np.arange(3)
    arm = (2.0 * RADIUS + GAP) / math.sqrt(3.0)
    return arm * np.stack([np.cos(angle), np.sin(angle), np.zeros(3)], axis=1)


def scene(grains: dict, width: float, *, clumps: bool, step: float = STEP, heavy: float = 1.0) -> warpdem.Scene:
    """Grains in a box without a lid, ``heavy`` times as dense as they are."""
    planes = [([0, 0, 0], [0, 0, 1]), ([0, 0, 0], [1, 0, 0]), ([width, 0, 0], [-1, 0, 0]), ([0, 0, 0], [0, 1, 0]),
              ([0, width, 0], [0, -1, 0])]  # fmt: skip
    stuff = {key: getattr(MATERIAL, key) for key in ("young_modulus", "poisson_ratio")}
    three = {"spheres": [{"centre": list(centre), "radius": RADIUS} for centre in template().tolist()]}
    return warpdem.Scene.model_validate({
        "materials": {"grain": {"density": heavy * MATERIAL.density, **stuff}},
        "contact": {"tangential": LAW, "rolling": "none"},
        "pairs": [
            {"materials": ["grain", "grain"], "restitution": MATERIAL.restitution, "friction": MATERIAL.friction}
        ],
        "clumps": {"three": three} if clumps else {}, "grains": [{"material": "grain", **grains}],
        "walls": [
            {"name": name, "material": "grain", "plane": {"point": point, "normal": normal}}
            for name, (point, normal) in zip(("floor", "west", "east", "south", "north"), planes, strict=True)
        ],
        "gravity": [0.0, 0.0, -9.81 / heavy], "time": {"end": 1.0, "step": step}, "engine": {"skin": SKIN},
        "output": {"formats": ["vtk"]},
    })  # fmt: skip


def side(count: int) -> float:
    """Width of the box of ``count`` clumps [m]."""
    return (3 * count * 4.0 / 3.0 * math.pi * RADIUS**3 / FRACTION) ** (1.0 / 3.0)


def beds(count: int, settle: int, work: Path, threads: int = 1) -> dict[str, warpdem.Simulation]:
    """The settled bed as clumps and as free spheres."""
    width = side(count)
    kept = work / f"clumps_{count}_{settle}.npz"
    if not kept.exists():
        box = {"min": [0.0, 0.0, 0.0], "max": [width] * 3}
        fill = {"box": box, "count": count, "seed": 1}
        made = scene({"clump": "three", "fill": fill}, width, clumps=True, step=SETTLING)
        sim = warpdem.Simulation(made, device="cpu", threads=1)
        sim.step(settle)
        c, p = sim.clumps, sim.particles
        np.savez(kept, x=c.position, q=c.orientation, v=c.velocity, w=c.spin, members=p.position)
        sim.threads.close()
    with np.load(kept) as data:
        motion = {"velocities": data["v"], "spins": data["w"]}
        bodies = {"clump": "three", "positions": data["x"], "orientations": data["q"], **motion}
        free = {"positions": data["members"], "radius": RADIUS}
    return {
        "clumps": warpdem.Simulation(scene(bodies, width, clumps=True), device="cpu", threads=threads),
        "spheres": warpdem.Simulation(scene(free, width, clumps=False, heavy=HEAVY), device="cpu", threads=threads),
    }


def hold_width(sim: warpdem.Simulation) -> None:
    """Let each inner list be as wide as the first."""
    setattr(type(sim.lists), "next_inner_share", property(lambda lists: lists.inner_share))  # noqa: B010


def touching(sim: warpdem.Simulation) -> float:
    """Pressed contacts per sphere, walls included [-]."""
    return float((sim.contacts().overlap > 0.0).sum()) / len(sim.state)


def bench(
    count: int, *, warm: int, steps: int, repeats: int, launches: int, settle: int, work: Path, threads: int = 1
) -> dict:  # fmt: skip
    """Both beds, one row each."""
    work.mkdir(parents=True, exist_ok=True)
    sims, load = beds(count, settle, work, threads), OtherLoad()
    clock = time.process_time if threads == 1 else time.perf_counter  # threads that wait count as well
    contacts: dict[str, list[float]] = {name: [] for name in sims}
    for name, sim in sims.items():
        hold_width(sim)
        sim.step(warm)
        contacts[name].append(touching(sim))
    seconds: dict[str, list[float]] = {name: [] for name in sims}
    for _ in range(repeats):
        for name, sim in sims.items():
            begin = clock()
            sim.step(steps)
            seconds[name].append(clock() - begin)
    for name, sim in sims.items():
        contacts[name].append(touching(sim))
    parts = {name: phases(sim, launches) for name, sim in sims.items()}
    rows = [
        {
            "bed": name, "spheres": len(sim.state), "lanes": sim.plan.backend.lanes, "contacts_per_sphere": contacts[name],
            "listed_per_sphere": sim.lists.contact_count / len(sim.state),
            "us_per_step": {"min": 1e6 * min(seconds[name]) / steps, "all": [1e6 * s / steps for s in seconds[name]]},
            "over_spheres": min(seconds[name]) / min(seconds["spheres"]), "phases_us": parts[name],
        }
        for name, sim in sims.items()
    ]  # fmt: skip
    for sim in sims.values():
        sim.threads.close()
    return {"machine": machine(), "commit": commit(), "clumps": count, "steps": steps, "threads": threads,
            "beds": rows, "other_load_cores": load.cores()}  # fmt: skip


# --- LIGGGHTS --------------------------------------------------------------------------------------------------------


def deck(count: int, settle: int, steps: int) -> str:
    """Input deck of LIGGGHTS: the same clumps packed in a box of the same ground, settled, then the timed ``steps``."""
    width = side(count)
    spheres = " ".join(f"{x:.9g} {y:.9g} {z:.9g} {RADIUS:.9g}" for x, y, z in template().tolist())
    law = f"model hertz {liggghts.MODELS['no_rolling']}"
    height = 3.0 * width
    properties = [
        ("youngsModulus peratomtype", MATERIAL.young_modulus),
        ("poissonsRatio peratomtype", MATERIAL.poisson_ratio),
        ("coefficientRestitution peratomtypepair 1", MATERIAL.restitution),
        ("coefficientFriction peratomtypepair 1", MATERIAL.friction),
    ]  # fmt: skip
    lines = [
        "units si", "atom_style granular", "atom_modify map array", "boundary f f f", "newton off",
        "communicate single vel yes",
        "processors * * 1",
        f"region domain block 0 {width:.9g} 0 {width:.9g} 0 {height:.9g} units box",
        "create_box 1 domain",
        f"neighbor {SKIN:.9g} bin", "neigh_modify delay 0",
        *(f"fix property{k} all property/global {name} {value:.9g}" for k, (name, value) in enumerate(properties)),
        f"pair_style gran {law}", "pair_coeff * *",
        *liggghts.box_walls(law, width),
        "fix weight all gravity 9.81 vector 0 0 -1",
        f"fix three all particletemplate/multisphere 15485863 atom_type 1 volume_limit 1e-16 "
        f"density constant {MATERIAL.density} nspheres 3 ntry 1000000 spheres {spheres} type 1",
        "fix sizes all particledistribution/discrete 15485867 1 three 1.0",
        "fix insertion all insert/pack seed 32452843 distributiontemplate sizes maxattempt 500 insert_every once "
        f"overlapcheck yes orientation random all_in yes vel constant 0 0 0 region domain particles_in_region {count}",
        "fix motion all multisphere",
        f"timestep {SETTLING:.9g}", "thermo_style custom step atoms ke", f"thermo {settle + steps}",
        "thermo_modify lost ignore norm no", f"run {settle}",
        f"timestep {STEP:.9g}", f"run {steps}",
        "compute touching all contact/atom", "compute contacts all reduce sum c_touching",
        "thermo_style custom step atoms ke c_contacts", "thermo_modify lost ignore norm no", "run 0",
    ]  # fmt: skip
    return "\n".join(lines) + "\n"


def peer_row(count: int, settle: int, steps: int, work: Path, threads: int) -> dict | None:
    """A row of LIGGGHTS; None where it is not installed."""
    if liggghts.version() is None:
        return None
    text = liggghts.output_of(deck(count, settle, steps), work, threads)
    found = liggghts.parse(text, steps)
    return {"bed": "LIGGGHTS (wall time)", "spheres": found.grains, "us_per_step": {"min": 1e6 * found.seconds / steps},
            "contacts_per_sphere": [0.5 * found.contacts_per_grain], "rebuilds": found.rebuilds}  # fmt: skip


def print_report(report: dict, console: Console) -> None:
    """One line per bed."""
    title = f"{report['clumps']} clumps of three spheres, windows of {report['steps']} steps on {report['threads']} threads"
    table = Table(box=SIMPLE, title=f"{title}; load of others {report['other_load_cores']:.1f} cores", title_justify="left")
    measured = "spheres", "contacts per sphere", "listed", "us per step", "over spheres", "pairs, us", "walls, us", "motion, us"
    for column in ("bed", *measured):
        table.add_column(column, justify="left" if column == "bed" else "right")
    for row in report["beds"]:
        phase = row.get("phases_us", {})
        table.add_row(
            row["bed"], str(row["spheres"]), " to ".join(f"{c:.3f}" for c in row["contacts_per_sphere"]),
            f"{row['listed_per_sphere']:.2f}" if "listed_per_sphere" in row else "",
            f"{row['us_per_step']['min']:.0f}", f"{row['over_spheres']:.2f}" if "over_spheres" in row else "",
            *(f"{phase[name]:.0f}" if phase else "" for name in ("pairs", "walls", "motion")),
        )  # fmt: skip
    console.print(table)


app = App(help=__doc__, version_flags=(), default_parameter=Parameter(consume_multiple=True, negative=()))


@app.default
def main(
    *,
    clumps: int = 20_000,
    warm: int = 50,
    steps: int = 20,
    repeats: int = 40,
    launches: int = 300,
    settle: int = 25_000,
    threads: int = 1,
    peer: bool = False,
    work: Path = Path("bench"),
    out: Path | None = None,
) -> None:
    """Time a bed of clumps and the same bed of free spheres.

    Args:
        clumps: Number of clumps, of three spheres each.
        warm: Steps before the windows.
        steps: Timed steps of a window; few, so that the least window is one in which no list is made.
        repeats: Windows of each bed.
        launches: Launches of each phase alone, of which the least counts.
        settle: Steps that the bed settles for; it is kept in ``work``.
        threads: Threads of the windows; with more than one wall time counts. The phases alone run on one.
        peer: Beside LIGGGHTS, where it is installed.
        work: Folder of the states.
        out: File of the report, JSON.
    """
    report = bench(
        clumps, warm=warm, steps=steps, repeats=repeats, launches=launches, settle=settle, work=work, threads=threads
    )
    if peer:
        report["beds"] += filter(None, [peer_row(clumps, 2 * settle, 50 * steps, work, threads)])
    print_report(report, Console(highlight=False, width=None if sys.stdout.isatty() else 120))
    if out is not None:
        out.write_text(json.dumps(report, indent=1) + "\n")


if __name__ == "__main__":
    sys.exit(app())
