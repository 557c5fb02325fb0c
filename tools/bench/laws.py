"""What a normal law, or liquid beside Hertz, costs over Hertz: `python tools/bench/laws.py --help`; how to read it: README.md.

All laws start from one settled bed, each as strong as the weight of a grain, so that they have the same contacts. Their windows
take turns, processor time counts (of all threads), and the least of each: on a busy machine too the ratio says something. The
least window is one in which no list was made, which any law pays alike.
"""

import json
import math
import sys
import time
from collections.abc import Sequence
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))  # tools/

from cyclopts import App, Parameter
from rich.box import SIMPLE
from rich.console import Console
from rich.table import Table

import warpdem
from bench.states import DIAMETER, MATERIAL, MEAN_VOLUME, Model, Precision, Settings, Start, bed, scene_of
from bench.walls import phases
from bench.window import OtherLoad, commit, machine
from warpdem.scene.models import model_names

LAWS = ("hertz", "jkr", "dmt", "luding", "edinburgh", "bridge", "bridge_rabinovich")
WEIGHT = 9.81 * MATERIAL.density * MEAN_VOLUME  # of a grain of mean volume [N]
REDUCED_RADIUS = 0.125 * sum(DIAMETER)  # R* of two mean grains [m]
SURFACE_ENERGY = WEIGHT / (1.5 * math.pi * REDUCED_RADIUS)  # pulls as strong as the weight of a grain [J/m2]
SURFACE_TENSION = WEIGHT / (4.0 * math.pi * REDUCED_RADIUS)  # a bridge pulls as strong as the weight of a grain [N/m]
LIQUID_CONTENT = 0.02  # of the grains under a law of bridges [-]
STIFFNESS = 160.0  # Hertz's force over the overlap, summed over the bed [N/m]
KEYS = {
    "jkr": {"surface_energy": SURFACE_ENERGY},
    "jkr_fixed_load": {"surface_energy": SURFACE_ENERGY},
    "dmt": {"surface_energy": SURFACE_ENERGY},
    "sjkr": {"cohesion_energy_density": 1e4},
    "luding": {"stiffness": STIFFNESS, "unloading_stiffness": 1.2 * STIFFNESS, "adhesion_stiffness": 0.1 * STIFFNESS},
    "edinburgh": {"surface_energy": SURFACE_ENERGY, "pull_off_force": WEIGHT, "plasticity_ratio": 0.2},
    "bridge": {"surface_tension": SURFACE_TENSION},
    "bridge_rabinovich": {"surface_tension": SURFACE_TENSION},
}
"""Keys of ``[[pairs]]`` that a law needs."""


def simulation(law: str, start: Start, model: Model, settings: Settings) -> warpdem.Simulation:
    """The bed under a normal law, or under Hertz with liquid bridges, after the warm-up steps."""
    scene = json.loads(scene_of(start, model, settings).model_dump_json(exclude_unset=True))
    if law in model_names("liquid"):
        scene["contact"]["liquid"] = law
        scene["grains"][0]["liquid_content"] = LIQUID_CONTENT
    else:
        scene["contact"]["normal"] = law
    scene["pairs"][0] |= KEYS.get(law, {})
    sim = warpdem.Simulation(warpdem.Scene.model_validate(scene), device="cpu", threads=1, resident=settings.resident)
    sim.step(settings.warm)
    return sim


def timed(sim: warpdem.Simulation, steps: int) -> float:
    """Processor time of ``steps`` steps [s]."""
    begin = time.process_time()
    sim.step(steps)
    return time.process_time() - begin


def touching(sim: warpdem.Simulation) -> float:
    """Contacts that are pressed per grain, walls included [-]."""
    return float((sim.contacts().overlap > 0.0).sum()) / len(sim.state)


def pulling(sim: warpdem.Simulation) -> float:
    """Contacts that act per grain, pressed or held together by liquid, walls included [-]."""
    return len(sim.contacts().i) / len(sim.state)


def bench(
    laws: Sequence[str], model: Model, grains: int, settings: Settings, settle: int, work: Path, launches: int = 40
) -> dict:
    """One row per law, the first of which is Hertz."""
    work.mkdir(parents=True, exist_ok=True)
    start, load = bed(grains, work, settings, settle), OtherLoad()
    sims = {law: simulation(law, start, model, settings) for law in dict.fromkeys(("hertz", *laws))}
    seconds: dict[str, list[float]] = {law: [] for law in sims}
    for _ in range(settings.repeats):
        for law, sim in sims.items():
            seconds[law].append(timed(sim, settings.steps))
    contacts = {law: (touching(sim), pulling(sim)) for law, sim in sims.items()}
    pairs = dict.fromkeys(sims, math.inf)  # of one instant, by turns as well
    for _ in range(settings.repeats):
        for law, sim in sims.items():
            pairs[law] = min(pairs[law], phases(sim, launches, ["pairs"])["pairs"])
    per_step = 1e9 / grains / settings.steps
    rows = [
        {
            "law": law, "contacts_per_grain": contacts[law][0], "acting_per_grain": contacts[law][1],
            "lanes": sim.plan.backend.lanes,
            "over_hertz": min(seconds[law]) / min(seconds["hertz"]),
            "ns_per_grain_step": {"min": per_step * min(seconds[law]), "all": [per_step * s for s in seconds[law]]},
            "pairs_ns": 1e3 * pairs[law] / grains, "pairs_over_hertz": pairs[law] / pairs["hertz"],
        }
        for law, sim in sims.items()
    ]  # fmt: skip
    for sim in sims.values():
        sim.threads.close()
    return {"machine": machine(), "commit": commit(), "model": model, "grains": grains, "precision": settings.precision,
            "steps": settings.steps, "laws": rows, "other_load_cores": load.cores()}  # fmt: skip


def print_report(report: dict, console: Console) -> None:
    """One line per law."""
    title = f"{report['grains']} grains, {report['model']}, {report['precision']}, windows of {report['steps']} steps"
    table = Table(box=SIMPLE, title=f"{title}; load of others {report['other_load_cores']:.1f} cores", title_justify="left")
    for column in ("law", "pressed", "acting", "ns per step", "over Hertz", "pairs alone, ns", "over Hertz", "lanes"):
        table.add_column(column, justify="left" if column == "law" else "right")
    for row in report["laws"]:
        table.add_row(
            row["law"], f"{row['contacts_per_grain']:.3f}", f"{row['acting_per_grain']:.3f}",
            f"{row['ns_per_grain_step']['min']:.1f}", f"{row['over_hertz']:.2f}", f"{row['pairs_ns']:.1f}",
            f"{row['pairs_over_hertz']:.2f}", str(row["lanes"]),
        )  # fmt: skip
    console.print(table)


app = App(help=__doc__, version_flags=(), default_parameter=Parameter(consume_multiple=True, negative=()))


@app.default
def main(
    *,
    laws: Sequence[str] = LAWS,
    model: Model = "full",
    grains: int = 20_000,
    precision: Precision = "double",
    warm: int = 50,
    steps: int = 20,
    repeats: int = 40,
    launches: int = 40,
    settle: int = 20_000,
    work: Path = Path("bench"),
    out: Path | None = None,
) -> None:
    """Time a settled bed under each law and under Hertz.

    Args:
        laws: Normal laws, and laws of liquid bridges, which are joined to Hertz; Hertz is always among them.
        model: Full: tangential spring and rolling; no_rolling; frictionless: the normal law alone.
        grains: Grains of the bed.
        precision: Of the contact law.
        warm: Steps before the windows.
        steps: Timed steps of a window; few, so that the contacts stay those of the bed.
        repeats: Windows of each law.
        launches: Launches of the pair phase alone, of which the least counts.
        settle: Steps that the bed settles for; it is kept in ``work``.
        work: Folder of the states.
        out: File of the report, JSON.
    """
    settings = Settings("mindlin", warm=warm, steps=steps, repeats=repeats, precision=precision)
    report = bench(laws, model, grains, settings, settle, work, launches)
    print_report(report, Console(highlight=False, width=None if sys.stdout.isatty() else 120))
    if out is not None:
        out.write_text(json.dumps(report, indent=1) + "\n")


if __name__ == "__main__":
    sys.exit(app())
