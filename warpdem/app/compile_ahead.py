"""The kernels of a run, compiled by a second process while the first one reads meshes and places grains.

A scene tells nearly all that its kernels depend on before a grain has a place. The second process compiles what is probably
needed, the largest kernels first; the run itself, once it is ready, compiles what is still missing from the other end. Both
meet in Warp's cache of compiled kernels, which takes each under its own name and is safe to share: a wrong guess costs
nothing but the work, and no result depends on it. It has to be a process: the options of Warp's compiler on a CPU are
global to the process, so that two threads must not compile at once.
"""

import os
import pickle
import signal
import subprocess
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

import numpy as np
import warp as wp

from warpdem.core.device import pick_device
from warpdem.core.start_warp import start_warp
from warpdem.core.threads import available_threads
from warpdem.model import needs
from warpdem.model.choose_features import choose_features
from warpdem.model.compiled import compile_kernels, step_kernels
from warpdem.model.features import Features
from warpdem.model.lanes import as_the_law_allows, simd_lanes
from warpdem.model.schedule import Schedule
from warpdem.scene.grains import Grains
from warpdem.scene.model import Scene
from warpdem.scene.models import model


@contextmanager
def compiling_ahead(scene: Scene, device: str | None) -> Iterator[None]:
    """Let a second process compile the kernels of ``scene`` during the block, where that helps: a CPU run, an idle core.

    Args:
        scene: validated scene.
        device: as in ``Simulation``.

    Raises:
        SceneError: if there is no such device.
    """
    helper = _started(scene) if pick_device(device).is_cpu and _has_idle_core() else None
    try:
        yield
    finally:
        if helper is not None and helper.stdin is not None:
            with suppress(OSError):
                helper.stdin.close()  # it ends after the kernel it is at, so that no half of one is left in the cache
            threading.Thread(target=helper.wait, daemon=True).start()


def _has_idle_core() -> bool:
    """Whether a second process would not only take turns with this one."""
    cores = available_threads()
    try:
        return cores > 1 and os.getloadavg()[0] < cores - 0.5
    except (AttributeError, OSError):  # the system does not tell
        return cores > 1


def _started(scene: Scene) -> "subprocess.Popen[bytes] | None":
    """The second process at its work; None where nothing is missing, or it cannot be started."""
    features = likely_features(scene)
    if features is None or not sys.executable or not _is_missing(features):
        return None
    try:
        helper = subprocess.Popen(
            [sys.executable, "-P", "-m", __name__],  # -P: no module of the folder that a user happens to be in
            stdin=subprocess.PIPE,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
        )
        assert helper.stdin is not None
        helper.stdin.write(pickle.dumps((features, str(wp.config.kernel_cache_dir))))
        helper.stdin.flush()
    except OSError:
        return None
    return helper


def _is_missing(features: Features) -> bool:
    """Whether some kernel of the steps is not in Warp's cache yet."""
    modules = [kernel.module for kernel in step_kernels(compile_kernels(features))]
    cache = Path(str(wp.config.kernel_cache_dir))
    return not all((cache / module.get_module_identifier(1)).is_dir() for module in modules)  # 1: block of a CPU launch


def likely_features(scene: Scene) -> Features | None:
    """Features that a scene will have on a CPU, as far as it tells before its grains are placed.

    Returns:
        None where it does not: a start from another run, periodic borders beside walls, a law whose reach depends on the
        largest grain, models from files of the user.
    """
    normal = model("normal", scene.normal_law)
    if scene.start is not None or hasattr(normal, "gap"):
        return None
    names, scheme = list(scene.materials), model("integrator", scene.engine.integrator)
    schedule = Schedule(scene, scheme.STAGES, scheme.RELATIVE)
    features = choose_features(
        scene,
        np.array(
            [names.index(group.material) for group in scene.grains]
            + [names.index(portion.material) for stream in scene.streams for portion in stream.portions],
            np.int32,
        ),
        has_spin=any(group.positions is not None and bool(np.any(group.explicit_spins)) for group in scene.grains),
        moving=schedule.moving,
        resting=len(schedule.motions) - schedule.moving,
        images=False,
        clumps=bool(scene.clumps),
        lanes=simd_lanes(sum(map(_count, scene.grains)) + sum(needs.grains_to_come(scene)), scene.engine.precision),
    )
    borders_meet_walls = features.domain.periodic and features.walls.present
    return None if features.user_files or borders_meet_walls else as_the_law_allows(features)


def _count(group: Grains) -> int:
    """Grains of a group where it says so; else few, as most scenes have."""
    if group.positions is not None:
        return len(group.positions)
    return (group.fill.count if group.fill is not None else None) or 0


def main() -> None:
    """The second process: compile, one kernel after the other, until all are there or standard input ends."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C is for the run, which ends this process by itself
    features, cache = pickle.load(sys.stdin.buffer)
    over = threading.Event()

    def watch() -> None:
        while os.read(sys.stdin.buffer.fileno(), 1):  # not by the buffer: its lock stops the interpreter's end
            pass
        over.set()

    threading.Thread(target=watch, daemon=True).start()
    start_warp()
    wp.config.kernel_cache_dir = cache  # only now: before Warp's start its version would be added
    for kernel in step_kernels(compile_kernels(features)):
        if over.is_set():
            return
        wp.load_module(kernel.module, device="cpu")


if __name__ == "__main__":
    main()
