"""Reading of files in a process of its own: a library that crashes or hangs there ends that process, not the run."""

import io
import json
import os
import signal
import subprocess
import sys
from collections.abc import Sequence
from typing import Any

import numpy as np

from warpdem.errors import SceneError


def run_reader(
    program: str, arguments: Sequence[str], limit: float, head: str, library: str
) -> tuple[dict[str, Any], dict[str, np.ndarray]]:
    """Run a reader program on a file and return its answer.

    Args:
        program: Python file to run; it writes an .npz archive to standard output, in which the array ``answer`` is a text in
            JSON, with the reason as ``refused`` if the file cannot be used.
        arguments: Its arguments.
        limit: Wall time that it may take [s].
        head: Beginning of an error message: source, key and file.
        library: Name of the library that may crash, for messages.

    Returns:
        The answer, and the other arrays by name.

    Raises:
        SceneError: The file was refused, or the program crashed, failed, or took too long.
    """
    # one thread: a maliciously damaged file must not use all cores
    environment = {**os.environ, "PXR_WORK_THREAD_LIMIT": "1", "VTK_SMP_MAX_THREADS": "1"}
    command = [sys.executable, "-P", program, *arguments]
    try:
        completed = subprocess.run(
            command, check=False, capture_output=True, timeout=limit, env=environment, stdin=subprocess.DEVNULL
        )
    except subprocess.TimeoutExpired:
        raise SceneError(f"{head}: reading it took longer than {limit:.3g} s: damaged, or too large") from None
    answer: dict[str, Any] = {}
    arrays: dict[str, np.ndarray] = {}
    if completed.returncode == 0:
        with np.load(io.BytesIO(completed.stdout), allow_pickle=False) as archive:
            arrays = {name: archive[name] for name in archive.files}
        answer = json.loads(str(arrays.pop("answer")))
    elif completed.returncode == -getattr(signal, "SIGXCPU", 0):
        answer["refused"] = "reading it took more processor time than its size can need: damaged?"
    elif completed.returncode < 0:
        answer["refused"] = f"{library} crashed on it ({signal.Signals(-completed.returncode).name}): damaged?"
    else:
        last = completed.stderr.decode("utf-8", "replace").strip().splitlines()[-1:] or ["no reason given"]
        answer["refused"] = f"reading it failed: {last[0][:300]}"
    if "refused" in answer:
        raise SceneError(f"{head}: {answer['refused']}")
    return answer, arrays
