"""Files read by a program in a process of its own: a library that crashes, hangs or takes all memory ends that, not the run."""

import io
import json
import os
import signal
import subprocess
import sys
from collections.abc import Sequence

import numpy as np

from warpdem.errors import SceneError


def run_reader(
    program: str, arguments: Sequence[str], limit: float, head: str, library: str
) -> tuple[dict, dict[str, np.ndarray]]:
    """What a program says of a file.

    Args:
        program: Python file to run; it writes an .npz archive to standard output, in which the array ``answer`` is a text in
            JSON, with ``refused`` where it found no use for the file.
        arguments: Its arguments.
        limit: Time that it may take [s].
        head: How a message begins: source, key and file.
        library: Name of what may crash, for messages.

    Returns:
        The answer, and the other arrays by name.

    Raises:
        SceneError: The file was refused, or the program crashed, failed, or took too long.
    """
    # one thread: a file damaged on purpose shall not fill all cores either
    environment = {**os.environ, "PXR_WORK_THREAD_LIMIT": "1", "VTK_SMP_MAX_THREADS": "1"}
    command = [sys.executable, "-P", program, *arguments]
    try:
        done = subprocess.run(
            command, check=False, capture_output=True, timeout=limit, env=environment, stdin=subprocess.DEVNULL
        )
    except subprocess.TimeoutExpired:
        raise SceneError(f"{head}: reading it took longer than {limit:.3g} s: damaged, or too large") from None
    said, arrays = {}, {}
    if done.returncode == 0:
        with np.load(io.BytesIO(done.stdout), allow_pickle=False) as held:
            arrays = {name: held[name] for name in held.files}
        said = json.loads(str(arrays.pop("answer")))
    elif done.returncode == -getattr(signal, "SIGXCPU", 0):
        said["refused"] = "reading it took more processor time than its size can need: damaged?"
    elif done.returncode < 0:
        said["refused"] = f"{library} crashed on it ({signal.Signals(-done.returncode).name}): damaged?"
    else:
        last = done.stderr.decode("utf-8", "replace").strip().splitlines()[-1:] or ["no reason given"]
        said["refused"] = f"reading it failed: {last[0][:300]}"
    if "refused" in said:
        raise SceneError(f"{head}: {said['refused']}")
    return said, arrays
