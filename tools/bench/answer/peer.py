"""A case run with LIGGGHTS: its deck, and what it printed at the sample times."""

import re
from pathlib import Path

import numpy as np

from bench import liggghts
from bench.answer.cases import GRAVITY, Case, Rows, Run, rayleigh_step
from bench.states import MATERIAL

STEPS = {"paper": 1.0e-6, "rayleigh": 0.15 * rayleigh_step(), "longest": 2.5e-6}
"""Time steps [s]: that of the paper, 15 % of the Rayleigh time, the longest that still gives the hourglass's curve."""
HOW_TO_GET = (
    "LIGGGHTS is not installed: its runs are left out. It is only compared with and needed by nothing else; Debian and "
    "Ubuntu have 3.8 as a package: apt install liggghts (mpirun comes with it), or see https://www.cfdem.com"
)
SKIN = 0.1e-3  # [m], the best of those tried in the settled bed; scaled with the lengths
LAW = f"model hertz {liggghts.MODELS['full']}"


def every(case: Case, step: float) -> int:
    """Steps between two readings."""
    return max(1, round(case.sample / step))


def deck(case: Case, data: Path, shell: Path | None, rows: Path, step: float, ranks: int) -> str:
    """Input deck of a case: the motion, then what follows it; rows of time, share passed, x and z of the centre of mass.

    The domain is split along y, the axis of the motion: no rank is ever without grains.

    Args:
        case: What is run.
        data: Data file of the grains.
        shell: ASCII mesh of the walls; None for planes.
        rows: File of the rows.
        step: Time step [s].
        ranks: Processes.
    """
    turning = round(case.turn / step) if case.rate else 0
    last = round(case.end / step)
    lines = liggghts.head(data, MATERIAL, LAW, SKIN * case.scale, grid=f"1 {ranks} 1")
    if shell is None:
        lines += liggghts.box_walls(LAW, case.width)
    else:
        lines += [f"fix shell all mesh/surface file {shell} type 1",
                  f"fix contact all wall/gran {LAW} mesh n_meshes 1 meshes shell"]  # fmt: skip
    if turning:
        period = 2.0 * np.pi / case.rate
        lines += [f"fix turn all move/mesh mesh shell rotate origin 0. 0. 0. axis 0. 1. 0. period {period:.17g}"]
    lines += [
        f"fix weight all gravity {GRAVITY:.17g} vector 0 0 -1",
        "fix motion all nve/sphere",
        f"timestep {step:.17g}",
        "variable now equal step*dt",
        f"variable angle equal {case.rate:.17g}*dt*(step*(step<{turning})+{turning}*(step>={turning}))",
        "variable s equal sin(v_angle)",
        "variable c equal cos(v_angle)",
        "variable above atom mass*(x*v_s+z*v_c>0.0)",
        "variable weight atom mass",
        "compute above all reduce sum v_above",
        "compute all all reduce sum v_weight",
        "compute centre all com",
        "variable passed equal c_above/c_all",
        "variable xc equal c_centre[1]",
        "variable zc equal c_centre[3]",
        f"fix rows all print {every(case, step)} '${{now}} ${{passed}} ${{xc}} ${{zc}}' file {rows} screen no title 'rows'",
        "thermo_style custom step atoms ke",
        f"thermo {last}",
        "thermo_modify lost ignore norm no",
        "run 0",  # which writes the first row
    ]
    lines += [f"run {turning}", "unfix turn"] if turning else []
    lines += [f"run {last - turning}"] if last > turning else []
    return "\n".join(lines) + "\n"


def domain(case: Case, state: dict[str, np.ndarray]) -> np.ndarray:
    """Corners of a domain that holds the walls however they are turned, shape (2, 3) [m]."""
    if case.shell is None:
        return liggghts.domain_of(state, case.width, None)
    corners = case.shell.reshape(-1, 3)
    reach = np.array([np.hypot(corners[:, 0], corners[:, 2]).max(), np.abs(corners[:, 1]).max()])[[0, 1, 0]] * 1.03
    return np.array([-reach, reach])


def read(text: str, rows: Path, case: Case, step: float) -> Run:
    """What a run of `deck` has printed and written.

    Raises:
        PeerError: Something is missing or not finite.
    """
    loops = re.findall(r"Loop time of (\S+) on \d+ procs for (\d+) steps with (\d+) atoms", text)
    table = np.loadtxt(rows, skiprows=1, ndmin=2)
    if not loops or len(table) < case.end / case.sample / 2.0 or not np.isfinite(table).all():
        raise liggghts.PeerError(f"{case.name}: {len(table)} rows, or numbers that are not finite:\n{text[-1500:]}")
    steps = sum(int(count) for _, count, _ in loops)
    time, passed, x, z = table[np.unique(table[:, 0], return_index=True)[1]].T
    return Run(
        Rows(time, passed, x, z), step, steps, sum(float(s) for s, _, _ in loops), case.count - int(loops[-1][2])
    )


def run(case: Case, state: dict[str, np.ndarray], shell: Path | None, folder: Path, step: float, ranks: int) -> Run:
    """Run a case in ``folder``.

    Raises:
        PeerError: LIGGGHTS failed.
    """
    data, rows = folder / "grains.data", folder / "rows.txt"
    liggghts.write_data(data, state, MATERIAL.density, domain(case, state))
    return read(liggghts.output_of(deck(case, data, shell, rows, step, ranks), folder, ranks), rows, case, step)
