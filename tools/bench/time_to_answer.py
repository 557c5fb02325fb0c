"""Time to the answer of warpdem at its own step beside LIGGGHTS: `python tools/bench/time_to_answer.py --help`; README.md.

Three cases (answer/cases.py): half a turn and discharge of an hourglass, a bed settling, a drum. Each is defined once,
starts from one state for all, and is run to its end by a process of its own: wall and processor seconds are those of the
whole process, reading in the scene and the grains included, kernels compiled before. Twins, whose starts lie 1e-9 of a
radius apart, tell how far two equal answers lie apart; runs on other threads are twins too.

Every finished run is kept in the work folder: a call does what is not there yet, so that parts can be run one by one.
"""

import json
import platform
import resource
import sys
import tempfile
import time
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any, Literal

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))  # tools/

import numpy as np
from cyclopts import App, Parameter
from rich.box import SIMPLE
from rich.console import Console
from rich.markup import escape
from rich.table import Table

import warpdem
from bench import liggghts
from bench.answer import own, peer
from bench.answer.cases import Case, Run, cases
from bench.answer.compare import Done, compared, costs
from bench.states import write_ascii_stl
from bench.window import OtherLoad, commit, machine
from warpdem.core.atomic_file import replaced
from warpdem.core.threads import available_threads

Name = Literal["hourglass", "bed", "drum"]
Step = Literal["auto", "quarter", "paper", "rayleigh", "longest"]
OWN = {"auto": 1.0, "quarter": 0.25}
"""Settings of warpdem: its step over that of ``step = "auto"``."""
LABELS = {
    "auto": 'warpdem, "auto"',
    "quarter": 'warpdem, "auto" / 4',
    "paper": "LIGGGHTS, 1e-6 s",
    "rayleigh": "LIGGGHTS, 15 % Rayleigh",
    "longest": "LIGGGHTS, 2.5e-6 s",
}
NUDGE = 1e-9  # of a radius: how far the starts of twins lie apart
GRAINS, FEW = 5000, 300
NS_PER_GRAIN = {"warpdem": 110.0, "liggghts": 270.0}
"""What a grain costs per step on one thread [ns], turning walls included, roughly: for the estimate only."""


class Work:
    """The work folder: what all runs start from, and what was found.

    Args:
        folder: Made if it is not there.
        count: Grains.
        short: Whether this is a short look.

    Raises:
        SystemExit: The folder holds runs of another kind.
    """

    def __init__(self, folder: Path, count: int, short: bool) -> None:
        self.folder, self.cases = folder.resolve(), cases(count, short)
        self.folder.mkdir(parents=True, exist_ok=True)
        self.file = self.folder / "runs.json"
        kind = {"grains": count, "short": short}
        self.data: dict[str, Any] = {"kind": kind, "runs": {}}
        if self.file.exists():
            self.data = json.loads(self.file.read_text())
            if self.data["kind"] != kind:
                raise SystemExit(
                    f"--work {folder}: holds runs of {self.data['kind']}, not of {kind}: name another folder"
                )

    def shell(self, case: Case) -> Path | None:
        """Mesh of the walls, which both codes read; None for planes."""
        if case.shell is None:
            return None
        path = self.folder / f"{case.name}.stl"
        if not path.exists():
            write_ascii_stl(path, case.shell)
        return path

    def start(self, case: Case, console: Console) -> dict[str, np.ndarray]:
        """Grains at the start: x [m], r [m], v [m/s], w [rad/s]."""
        path = self.folder / f"{case.name}.npz"
        if not path.exists():
            console.print(f"{case.name}: placing {case.count} grains, {case.settle:.2g} s to settle")
            np.savez(path, **own.settled(case, self.shell(case)))
        with np.load(path) as data:
            return {key: data[key] for key in ("x", "r", "v", "w")}

    def done(self) -> list[Done]:
        """All finished runs."""
        parts = [(key.split("/"), record) for key, record in self.data["runs"].items()]
        return [Done(case, setting, int(n), int(twin), record) for (case, setting, n, twin), record in parts]

    def keep(self, key: str, record: dict[str, Any]) -> None:
        """Add a finished run to the file."""
        self.data["runs"][key] = record
        with replaced(self.file) as part:
            part.write_text(json.dumps(self.data) + "\n")


def nudged(state: dict[str, np.ndarray], *seed: int) -> dict[str, np.ndarray]:
    """A state with its centres moved by `NUDGE`."""
    away = np.random.default_rng(seed).standard_normal(state["x"].shape)
    return {**state, "x": state["x"] + NUDGE * state["r"][:, None] * away}


def peer_step(case: Case, setting: str) -> float:
    """Time step of the peer [s]: larger grains bear a longer one in proportion."""
    return peer.STEPS[setting] * case.scale


def estimate(case: Case, setting: str, threads: int) -> float:
    """About how long a run takes [s]; the own step of warpdem is not known before its scene is read."""
    code = "warpdem" if setting in OWN else "liggghts"
    step = 1.2e-6 * case.scale * OWN[setting] if setting in OWN else peer_step(case, setting)
    return 1e-9 * NS_PER_GRAIN[code] * case.count * case.end / step / (1.0 + 0.7 * (threads - 1))


def processor_seconds() -> float:
    """Processor time of all children that have ended [s]."""
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime


def measured(case: Case, setting: str, threads: int, twin: int, work: Work, console: Console) -> dict[str, Any]:
    """One run and what it cost."""
    shell, state = work.shell(case), work.start(case, console)
    state = nudged(state, twin, threads, list(LABELS).index(setting))
    with tempfile.TemporaryDirectory(dir=work.folder) as name:
        folder = Path(name)
        grains = folder / "grains.npz"
        np.savez(grains, **state)
        if setting in OWN:
            own.run(case, grains, shell, folder, OWN[setting], threads, only_compile=True)
        load, begin, used = OtherLoad(), time.perf_counter(), processor_seconds()
        run: Run | None
        if setting in OWN:
            run = own.run(case, grains, shell, folder, OWN[setting], threads)
        else:
            run = peer.run(case, state, shell, folder, peer_step(case, setting), threads)
        seconds, used, other = time.perf_counter() - begin, processor_seconds() - used, load.cores()
    assert run is not None
    return {
        "step": run.step, "steps": run.steps, "wall": seconds, "processor": used, "loop": run.loop, "load": other,
        "lost": run.lost, "rows": [column.tolist() for column in asdict(run.rows).values()], "commit": commit(),
        "code": f"warpdem {warpdem.__version__}" if setting in OWN else f"LIGGGHTS {liggghts.version()}",
        "machine": machine(), "python": platform.python_version(), "date": time.strftime("%Y-%m-%d %H:%M:%S"),
    }  # fmt: skip


def plan(work: Work, names: Sequence[str], settings: Sequence[str], threads: Sequence[int], twins: int) -> list[tuple]:
    """Runs that are not there yet: case, setting, threads, twin; twins come last, so that a part of all is soon complete."""
    wanted = [
        (work.cases[name], s, n, twin) for twin in range(twins) for name in names for s in settings for n in threads
    ]
    return [job for job in wanted if "/".join(map(str, (job[0].name, *job[1:]))) not in work.data["runs"]]


def report(work: Work, picture: Path, console: Console) -> dict[str, Any]:
    """Print what was found, draw it, and return it."""
    from bench.answer.picture import draw  # starts matplotlib

    runs = work.done()
    rows = costs(runs)
    table = Table(box=SIMPLE, title="seconds to the answer, the least of the runs", title_justify="left")
    for name in (
        "case",
        "setting",
        "threads",
        "step [s]",
        "steps",
        "wall",
        "processor",
        "stepping",
        "over auto",
        "load",
    ):
        table.add_column(escape(name), justify="left" if name in ("case", "setting") else "right", no_wrap=True)
    for row in rows:
        ratio = "" if row["over_own"] is None else f"{row['over_own']:.2f}"
        seconds = [f"{row[key]:.1f}" for key in ("wall", "processor", "loop")]
        table.add_row(row["case"], LABELS[row["setting"]], str(row["threads"]), f"{row['step']:.3g}", str(row["steps"]),
                      *seconds, ratio, f"{row['load']:.2f}")  # fmt: skip
    console.print(table)
    found = {
        name: compared(case, mine) for name, case in work.cases.items() if (mine := [r for r in runs if r.case == name])
    }
    for name, answers in found.items():
        _print_answers(name, answers, console)
    for run in runs:
        if run.record["lost"]:
            console.print(f"{run.case}, {LABELS[run.setting]} on {run.threads}: lost {run.record['lost']} grains")
    draw(work.cases, runs, rows, LABELS, picture)
    console.print(f"wrote {picture}", markup=False)
    return {"kind": work.data["kind"], "machine": runs[0].record["machine"], "costs": rows, "answers": found}


def _print_answers(name: str, found: dict[str, Any], console: Console) -> None:
    """Answers of a case as a table."""
    settings, names = list(found["answers"]), list(found["answers"][found["reference"]])
    title = f"{name}: mean (distance from {LABELS[found['reference']]}, in standard errors of the twins)"
    table = Table(box=SIMPLE, title=title, title_justify="left")
    for head in ("setting", *names, f"curve (twins {found['twins']:.2g})", "same answer"):
        table.add_column(escape(head), justify="left" if head == "setting" else "right", no_wrap=True)
    verdicts = {True: "yes", False: "NO", None: "-"}
    for s in settings:
        cells = [
            f"{one['mean']:.4g} ({one['difference_in_standard_errors']:+.1f})" for one in found["answers"][s].values()
        ]
        table.add_row(LABELS[s], *cells, f"{found['curves'][s]:.2g}",
                      "reference" if s == found["reference"] else verdicts[found["same"][s]])  # fmt: skip
    console.print(table)


def answer(
    *,
    names: Sequence[str],
    settings: Sequence[str],
    threads: Sequence[int],
    twins: int,
    work: Work,
    picture: Path,
    out: Path | None,
    console: Console,
    only_draw: bool = False,
    only_plan: bool = False,
) -> dict[str, Any] | None:
    """Run what is missing, and report; None where only the plan was asked for, or nothing has been run.

    Args:
        names: Cases.
        settings: Keys of `LABELS`.
        threads: Threads of warpdem, and processes of the peer.
        twins: Runs of each setting and number of threads.
        work: Work folder.
        picture: PNG to write.
        out: JSON of the report; none if not given.
        console: Where progress and tables go.
        only_draw: Run nothing.
        only_plan: Say what would be run, and how long about.
    """
    if not only_draw and liggghts.version() is None and set(settings) - OWN.keys():
        console.print(peer.HOW_TO_GET, markup=False, soft_wrap=True)
        settings = [s for s in settings if s in OWN]
    todo = [] if only_draw else plan(work, names, settings, threads, twins)
    left = sum(estimate(*job[:3]) for job in todo)
    if todo:
        console.print(f"{len(todo)} runs to do, about {left / 60:.0f} minutes on a quiet machine")
    for case, setting, n, twin in todo:
        about = estimate(case, setting, n)
        console.print(f"{case.name}, {LABELS[setting]}, {n} threads, twin {twin}: about {about:.0f} s", markup=False)
        if only_plan:
            continue
        record = measured(case, setting, n, twin, work, console)
        work.keep(f"{case.name}/{setting}/{n}/{twin}", record)
        costs = f"{record['wall']:.1f} s, {record['processor']:.1f} s of processors, load {record['load']:.2f}"
        console.print(f"    {record['steps']} steps of {record['step']:.3g} s: {costs}")
    if only_plan or not work.data["runs"]:
        return None
    found = report(work, picture, console)
    if out is not None:
        out.write_text(json.dumps(found, indent=2) + "\n")
        console.print(f"wrote {out}", markup=False)
    return found


app = App(help=__doc__, version_flags=(), default_parameter=Parameter(consume_multiple=True, negative=()))


@app.default
def main(
    *,
    case: list[Name] = ["hourglass", "bed", "drum"],  # noqa: B006
    steps: list[Step] = ["auto", "paper", "rayleigh", "longest"],  # noqa: B006
    threads: list[int] = [],  # noqa: B006
    twins: int = 1,
    grains: int | None = None,
    short: bool = False,
    draw: bool = False,
    plan: bool = False,
    work: Path = Path("time_to_answer"),
    picture: Path | None = None,
    out: Path | None = None,
) -> None:
    """Run what the work folder does not hold yet, print tables, draw the picture.

    Args:
        case: Cases.
        steps: auto: warpdem at its own step; quarter: a quarter of that; paper, rayleigh, longest: LIGGGHTS at 1e-6 s, at 15 %
            of the Rayleigh time, at 2.5e-6 s.
        threads: Threads of warpdem, processes of LIGGGHTS; 1 and all cores if not given.
        twins: Runs of each case, step and number of threads.
        grains: 5000 if not given, 300 in a short look.
        short: A look at the tool in a minute or two: few grains, ten times larger, and coarse walls; its times mean nothing.
        draw: Only tables and picture of what is there.
        plan: Only what would be run, and how long it would take about.
        work: Folder of the states and of the finished runs.
        picture: PNG to write; WORK/time_to_answer.png if not given.
        out: JSON to write beside it.
    """
    console = Console(highlight=False)
    if not console.is_terminal:
        console = Console(highlight=False, width=150)
    if twins < 1:
        raise SystemExit("--twins: at least 1")
    counts = tuple(threads) or ((1,) if short else tuple(sorted({1, available_threads()})))
    folder = Work(work, grains or (FEW if short else GRAINS), short)
    answer(names=case, settings=steps, threads=counts, twins=twins, work=folder, out=out, console=console,
           picture=picture or folder.folder / "time_to_answer.png", only_draw=draw, only_plan=plan)  # fmt: skip


if __name__ == "__main__":
    sys.exit(app())
