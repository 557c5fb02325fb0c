"""LIGGGHTS as the peer of `speed.py` and `time_to_answer.py`: input deck, data file, run, and what its output says.

Written for LIGGGHTS-PUBLIC 3.8 (`liggghts` and, for several ranks, `mpirun` on the PATH).
"""

import os
import re
import shutil
import subprocess
from dataclasses import dataclass
from pathlib import Path

import numpy as np

MODELS = {
    "full": "tangential history rolling_friction cdt",
    "no_rolling": "tangential history",
    "frictionless": "tangential off",
}
"""Words of the contact model after `model hertz`, by the name of the benchmark's model."""
HEAD_ROOM = 5e-3
"""Free height above a bed inside the domain [m]; what leaves the domain is lost."""


@dataclass(frozen=True)
class Window:
    """What one timed run gave."""

    seconds: float
    """Wall time of the timed steps [s]."""
    grains: int
    contacts_per_grain: float
    """Touching grain-grain pairs times two over grains, at the end [-]."""
    kinetic: float
    """Translational kinetic energy at the end [J]."""
    rebuilds: int
    """Neighbour list builds within the timed steps."""
    pair_share: float
    """Share of the time spent on grain-grain forces [-]."""
    neighbour_share: float
    """Share of the time spent on neighbour lists [-]."""


class PeerError(RuntimeError):
    """The peer failed; the message holds the end of its output."""


def version() -> str | None:
    """Version string, or None if LIGGGHTS is not installed."""
    if shutil.which("liggghts") is None:
        return None
    command = ["liggghts", "-log", "none"]
    done = subprocess.run(command, check=False, input="units si\n", capture_output=True, text=True)
    found = re.search(r"\(Version ([^,)]+)", done.stdout)
    return found[1] if found else "unknown version"


def write_data(path: Path, state: dict[str, np.ndarray], density: float, domain: np.ndarray) -> None:
    """Write grains as a data file of atom style granular.

    Args:
        path: File to write.
        state: Positions x [m], radii r [m], velocities v [m/s], spins w [rad/s], shapes (n, 3), (n,), (n, 3), (n, 3).
        density: Density [kg/m3].
        domain: Lowest and highest corner of the domain [m], shape (2, 3).
    """
    n = len(state["r"])
    number = np.arange(1, n + 1)
    atoms = np.column_stack([number, np.ones(n), 2.0 * state["r"], np.full(n, density), state["x"]])
    motion = np.column_stack([number, state["v"], state["w"]])
    with path.open("w") as file:
        file.write(f"grains\n\n{n} atoms\n1 atom types\n\n")
        for low, high, axis in zip(*domain, "xyz", strict=True):
            file.write(f"{low:.17g} {high:.17g} {axis}lo {axis}hi\n")
        file.write("\nAtoms\n\n")
        np.savetxt(file, atoms, fmt="%d %d %.17g %.17g %.17g %.17g %.17g")
        file.write("\nVelocities\n\n")
        np.savetxt(file, motion, fmt="%d" + 6 * " %.17g")


def deck(
    data: Path,
    material,
    model: str,
    *,
    step: float,
    skin: float,
    warm: int,
    steps: int,
    width: float | None = None,
    mesh: Path | None = None,
) -> str:
    """Input deck: ``warm`` steps, then the timed ``steps``, then one evaluation that counts contacts.

    Args:
        data: Data file of the grains.
        material: Has young_modulus [Pa], poisson_ratio, restitution, friction, rolling_friction [-].
        model: Key of `MODELS`.
        step: Time step [s].
        skin: Skin of the neighbour list [m].
        warm: Steps before the timed ones.
        steps: Timed steps.
        width: Walls are the floor z = 0 and four sides x, y = 0 and ``width`` [m]; this or mesh.
        mesh: Walls are this STL file (ASCII, metres).
    """
    law = f"model hertz {MODELS[model]}"
    if mesh is not None:
        walls = [
            f"fix shell all mesh/surface file {mesh} type 1",
            f"fix contact all wall/gran {law} mesh n_meshes 1 meshes shell",
        ]
    else:
        walls = box_walls(law, width)
    lines = [
        *head(data, material, law, skin),
        *walls,
        "fix weight all gravity 9.81 vector 0 0 -1",
        "fix motion all nve/sphere",
        f"timestep {step:.17g}",
        "thermo_style custom step atoms ke",
        f"thermo {warm + steps}",
        "thermo_modify lost ignore norm no",
        f"run {warm}",
        f"run {steps}",
        # counted after the timed run: this compute builds a list of its own
        "compute touching all contact/atom",
        "compute contacts all reduce sum c_touching",
        "thermo_style custom step atoms ke c_contacts",
        "thermo_modify lost ignore norm no",
        "run 0",
    ]
    return "\n".join(lines) + "\n"


def head(data: Path, material, law: str, skin: float, grid: str = "* * 1") -> list[str]:
    """Lines of a deck up to the contact law of the grains.

    Args:
        data: Data file of the grains.
        material: As in `deck`.
        law: Words of the contact model.
        skin: Skin of the neighbour list [m].
        grid: Ranks along each axis; * leaves the choice to the program.
    """
    return [
        "units si",
        "atom_style granular",
        "atom_modify map array",
        "boundary f f f",
        "newton off",
        "communicate single vel yes",
        f"processors {grid}",
        f"read_data {data}",
        f"neighbor {skin:.17g} bin",
        "neigh_modify delay 0",
        f"fix young all property/global youngsModulus peratomtype {material.young_modulus:.17g}",
        f"fix poisson all property/global poissonsRatio peratomtype {material.poisson_ratio:.17g}",
        f"fix bounce all property/global coefficientRestitution peratomtypepair 1 {material.restitution:.17g}",
        f"fix slide all property/global coefficientFriction peratomtypepair 1 {material.friction:.17g}",
        f"fix roll all property/global coefficientRollingFriction peratomtypepair 1 {material.rolling_friction:.17g}",
        f"pair_style gran {law}",
        "pair_coeff * *",
    ]


def box_walls(law: str, width: float | None) -> list[str]:
    """Lines of the floor z = 0 and the four sides x, y = 0 and ``width`` [m]."""
    places = {"floor": ("z", 0.0), "west": ("x", 0.0), "east": ("x", width), "south": ("y", 0.0), "north": ("y", width)}
    return [
        f"fix {name} all wall/gran {law} primitive type 1 {axis}plane {place:.17g}"
        for name, (axis, place) in places.items()
    ]


def parse(text: str, steps: int) -> Window:
    """What the output of a run of `deck` says about its ``steps`` timed steps.

    Raises:
        PeerError: Something is missing, or the energy is not finite.
    """
    loop = re.search(
        rf"Loop time of (\S+) on \d+ procs for {steps} steps with (\d+) atoms(.*?)Loop time of", text, re.S
    )
    if loop is None:
        raise PeerError(f"no loop time of {steps} steps in the output of LIGGGHTS:\n{text[-1500:]}")
    seconds, grains, after = float(loop[1]), int(loop[2]), loop[3]
    numbers = {
        key: re.search(pattern, after)
        for key, pattern in {
            "pair": r"Pair +time \(%\) = \S+ \(([^)]+)\)",
            "neighbour": r"Neigh +time \(%\) = \S+ \(([^)]+)\)",
            "rebuilds": r"Neighbor list builds = (\d+)",
            "last": r"Step\s+Atoms\s+KinEng\s+\w*contacts\w*\s+\d+\s+\d+\s+(\S+)\s+(\S+)",
        }.items()
    }
    missing = [key for key, found in numbers.items() if found is None]
    if missing:
        raise PeerError(f"no {', '.join(missing)} in the output of LIGGGHTS:\n{text[-1500:]}")
    kinetic, touching = (float(v) for v in numbers["last"].groups())
    if not np.isfinite([kinetic, touching]).all():
        raise PeerError(f"LIGGGHTS ended with a kinetic energy of {kinetic} J and {touching} contacts")
    return Window(
        seconds=seconds,
        grains=grains,
        contacts_per_grain=touching / grains,
        kinetic=kinetic,
        rebuilds=int(numbers["rebuilds"][1]),
        pair_share=float(numbers["pair"][1]) / 100.0,
        neighbour_share=float(numbers["neighbour"][1]) / 100.0,
    )


def domain_of(state: dict[str, np.ndarray], width: float | None, shell: np.ndarray | None) -> np.ndarray:
    """Corners of a domain that holds the walls, shape (2, 3) [m]; ``shell`` are the bounds of a mesh."""
    if shell is not None:
        return shell + 0.02 * np.ptp(shell, axis=0) * np.array([[-1.0], [1.0]])
    return np.array([[0.0, 0.0, 0.0], [width, width, float(state["x"][:, 2].max()) + HEAD_ROOM]])


def run(deck_text: str, folder: Path, ranks: int, steps: int) -> Window:
    """Run a deck in ``folder`` with that many ranks.

    Raises:
        PeerError: LIGGGHTS failed or lost grains.
    """
    return parse(output_of(deck_text, folder, ranks), steps)


def output_of(deck_text: str, folder: Path, ranks: int) -> str:
    """What a run of a deck in ``folder`` with that many ranks prints.

    Raises:
        PeerError: LIGGGHTS failed.
    """
    deck_file = folder / "in.liggghts"
    deck_file.write_text(deck_text)
    command = ["liggghts", "-in", str(deck_file), "-log", "none"]
    environment = dict(os.environ, OMP_NUM_THREADS="1")
    if ranks > 1:
        command = ["mpirun", "--oversubscribe", "--bind-to", "core", "-np", str(ranks), *command]
        if os.geteuid() == 0:
            environment |= {"OMPI_ALLOW_RUN_AS_ROOT": "1", "OMPI_ALLOW_RUN_AS_ROOT_CONFIRM": "1"}
    done = subprocess.run(
        command,
        check=False,  # the message below says more
        cwd=folder,
        env=environment,
        capture_output=True,
        text=True,
        stdin=subprocess.DEVNULL,
    )
    if done.returncode != 0:
        raise PeerError(f"{' '.join(command)} ended with {done.returncode}:\n{(done.stdout + done.stderr)[-1500:]}")
    return done.stdout
