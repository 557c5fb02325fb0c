"""One timed window of warpdem from a state, and what must be known about the machine beside it."""

import gc
import platform
import resource
import shutil
import subprocess
import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from statistics import median

import numpy as np
import psutil
import warp as wp

import warpdem
from bench import launches
from bench.states import ROOT, Model, Settings, Start, scene_of
from warpdem.core.threads import available_threads


class OtherLoad:
    """Cores that other processes kept busy since this was made: a timing is clean near 0."""

    def __init__(self) -> None:
        self._from = self._now()

    @staticmethod
    def _now() -> tuple[float, float, float]:
        cpu = psutil.cpu_times()
        own = sum(sum(resource.getrusage(who)[:2]) for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN))
        return time.perf_counter(), cpu.user + cpu.nice + cpu.system, own

    def cores(self) -> float:
        """Busy cores that are not ours [-]."""
        wall, busy, own = (now - then for now, then in zip(self._now(), self._from, strict=True))
        return max(0.0, busy - own) / wall


@dataclass(frozen=True)
class Window:
    """What one window of warpdem gave."""

    seconds: float
    contacts_per_grain: float
    wall_contacts: int
    rebuilds: int
    refreshes: int
    shares: dict[str, float]
    """Share of the time by stage: steps, lists (near list rebuilt), refresh (contact list), schedule."""
    bytes_per_grain: int
    """Device memory by the plan [B]; on a GPU as measured, with what Warp keeps for later."""
    device: dict
    """Time of each launch of the captured graph, and what it moves; empty where there is none."""


def window(start: Start, model: Model, threads: int, settings: Settings) -> Window:
    """One window of warpdem.

    Raises:
        RuntimeError: the state is not finite at the end.
    """
    device = wp.get_device(settings.device)
    gc.collect()  # the simulation of the window before, which refers to itself
    taken = wp.get_mempool_used_mem_current(device) if device.is_cuda else 0
    scene = scene_of(start, model, settings)
    sim = warpdem.Simulation(scene, device=settings.device, threads=threads, resident=settings.resident)
    sim.step(settings.warm)
    before, rebuilds, refreshes = dict(sim.seconds), sim.lists.rebuilds, sim.lists.inner_rebuilds
    begin = time.perf_counter()
    sim.step(settings.steps)
    seconds = time.perf_counter() - begin
    stages = {
        key: sim.seconds.get(key, 0.0) - before.get(key, 0.0) for key in ("steps", "lists", "refresh", "schedule")
    }
    rebuilds, refreshes = sim.lists.rebuilds - rebuilds, sim.lists.inner_rebuilds - refreshes
    particles, contacts = sim.particles, sim.contacts()
    if not all(np.isfinite(a).all() for a in (particles.position, particles.velocity, particles.spin)):
        raise RuntimeError(f"{start.name}, {model}: the state is not finite after {sim.step_number} steps")
    with_wall = int((contacts.j < 0).sum())
    grains = len(start.state["r"])
    held = (wp.get_mempool_used_mem_current(device) - taken) // grains if device.is_cuda else sim.plan.bytes_per_grain
    on_device = launches.measured(sim, settings.steps) if sim.plan.backend.resident else {}
    sim.threads.close()
    return Window(
        seconds=seconds,
        contacts_per_grain=2.0 * (len(contacts.j) - with_wall) / len(start.state["r"]),
        wall_contacts=with_wall,
        rebuilds=rebuilds,
        refreshes=refreshes,
        shares={key: value / seconds for key, value in stages.items()},
        bytes_per_grain=int(held),
        device=on_device,
    )


def spread(seconds: Sequence[float], grains: int, steps: int) -> dict[str, float | list[float]]:
    """Median, least and all values of the time per grain and step [ns]."""
    values = [1e9 * s / grains / steps for s in seconds]
    return {"median": median(values), "min": min(values), "all": values}


def machine() -> dict[str, str | int]:
    """Processor and cores."""
    info = Path("/proc/cpuinfo")
    names = (
        [line.split(":", 1)[1].strip() for line in info.read_text().splitlines() if "model name" in line]
        if info.exists()
        else []
    )
    return {
        "processor": names[0] if names else platform.processor(),
        "cores": available_threads(),
        "system": platform.platform(),
    }


def commit() -> str | None:
    """Commit of the working tree, with "+" when files differ from it; None outside a repository."""

    def git(*words: str) -> str:
        done = subprocess.run(["git", "-C", str(ROOT), *words], check=False, capture_output=True, text=True)
        return done.stdout.strip()

    if shutil.which("git") is None or not (head := git("rev-parse", "HEAD")):
        return None
    return head + ("+" if git("status", "--porcelain", "--untracked-files=no") else "")
