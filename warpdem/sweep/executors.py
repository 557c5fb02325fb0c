"""What runs several rows at once: processes here, or those of MPI, Dask or SLURM through their own libraries."""

from __future__ import annotations

import os
import subprocess
import threading
from collections.abc import Callable, Iterator
from concurrent.futures import Executor, Future, ThreadPoolExecutor
from contextlib import AbstractContextManager, contextmanager, suppress
from dataclasses import replace
from importlib import import_module
from pathlib import Path
from queue import SimpleQueue
from typing import Any

from warpdem.errors import SceneError
from warpdem.sweep.worker import Task, run_row

LIBRARIES = {
    "mpi": ("mpi4py.futures", "mpi4py"),
    "dask": ("dask.distributed", "distributed"),
    "slurm": ("submitit", "submitit"),
}
"""Module and package that each kind of executor needs; "local" needs none."""
KINDS = ("local", *LIBRARIES)
ENDING = 60.0
"""Time that interrupted rows get to write their checkpoints [s]."""

Submit = Callable[[Task], "Future[int]"]
Factory = Callable[[int, int, Path, int], AbstractContextManager[Submit]]
"""An executor of your own: called as `executor` without the kind, it gives a context in which rows can be submitted."""

def require(kind: str | Factory) -> None:
    """Refuse a kind of executor that is unknown or whose library is not installed.

    Raises:
        SceneError: with the package to install.
    """
    if callable(kind):
        return
    if kind not in KINDS:
        raise SceneError(f"--on {kind}: is unknown; allowed are {', '.join(KINDS)}")
    if kind in LIBRARIES:
        module, package = LIBRARIES[kind]
        try:
            import_module(module)
        except Exception as error:  # whatever a library raises where MPI or SLURM is missing
            raise SceneError(f"--on {kind}: needs the package {package}: pip install {package} ({error})") from error


@contextmanager
def executor(kind: str | Factory, workers: int, threads: int, folder: Path, gpus: int) -> Iterator[Submit]:
    """Something to submit rows to; rows that still run when the block is left by an interrupt write their checkpoints.

    Args:
        kind: one of `KINDS`, or an executor of your own.
        workers: rows at once; of MPI as many as processes were started, less one.
        threads: CPU threads of a row.
        folder: of the sweep, for the logs of SLURM.
        gpus: number of GPUs that local workers share, worker k the GPU k mod ``gpus``; 0 leaves the device to the task.
    """
    if callable(kind):
        with kind(workers, threads, folder, gpus) as submit:
            yield submit
        return
    if kind == "local":
        with _local(workers, gpus) as submit:
            yield submit
        return
    pool: Any
    if kind == "mpi":
        _require_launcher()
        with import_module("mpi4py.futures").MPIPoolExecutor() as pool:
            yield lambda task: pool.submit(run_row, task)
    elif kind == "dask":
        distributed = import_module("dask.distributed")
        # its threads wait for processes of their own; a scheduler elsewhere comes from Dask's own settings
        address = import_module("dask").config.get("scheduler-address", None)
        local = {"n_workers": workers, "threads_per_worker": 1, "processes": False, "dashboard_address": None}
        with distributed.Client(address) if address else distributed.Client(**local) as client:
            yield lambda task: client.get_executor(pure=False).submit(run_row, task)
    else:
        pool = import_module("submitit").AutoExecutor(folder=str(folder / "slurm"))
        pool.update_parameters(cpus_per_task=threads, name="warpdem-sweep")
        yield lambda task: _of_job(pool.submit(run_row, task))


@contextmanager
def _local(workers: int, gpus: int) -> Iterator[Submit]:
    """Threads that wait each for a process."""
    slots: SimpleQueue[int] = SimpleQueue()
    for number in range(workers):
        slots.put(number)
    running: set[subprocess.Popen[str]] = set()
    ending = threading.Event()

    def run(task: Task) -> int:
        if ending.is_set():
            return 130
        slot = slots.get()
        mine: list[subprocess.Popen[str]] = []

        def started(process: subprocess.Popen[str]) -> None:
            mine.append(process)
            running.add(process)
            if ending.is_set():
                process.terminate()

        try:
            return run_row(replace(task, device=f"cuda:{slot % gpus}") if gpus else task, started)
        finally:
            running.difference_update(mine)
            slots.put(slot)

    pool: Executor = ThreadPoolExecutor(workers)
    try:
        yield lambda task: pool.submit(run, task)
    except BaseException:
        ending.set()
        for process in list(running):
            with suppress(OSError):
                process.terminate()  # on this signal a run writes its checkpoint
        raise
    finally:
        pool.shutdown(wait=True, cancel_futures=True)


def _of_job(job: Any) -> Future[int]:
    """A future of a job of submitit, which is much like one."""
    future: Future[int] = Future()

    def wait() -> None:
        try:
            future.set_result(int(job.result()))
        except Exception as error:  # of the job or of the cluster: whoever asks for the result gets it
            future.set_exception(error)

    threading.Thread(target=wait, daemon=True).start()
    return future


def _require_launcher() -> None:
    """Raise where the MPI library would wait for ever for workers: MPICH starts none for a program that it has not started.

    Raises:
        SceneError: with the command that does.
    """
    library = import_module("mpi4py.MPI").Get_library_version()
    if "MPICH" in library and "PMI_RANK" not in os.environ:
        words = "MPICH starts workers only for a program that mpiexec has started"
        raise SceneError(f"--on mpi: {words}: mpiexec -n 1 warpdem sweep ..., or take --on local")
