"""DEME (PyPI package `deme`, one GPU) as the peer of `speed.py` on settled beds.

Written after its Python demos, and not run yet: there was no GPU. Its contacts are float32 with history, positions fixed-point;
radii are sorted into a few templates, for each template is compiled into its kernels. It counts the contacts that it lists.
"""

import importlib.util
import time
from importlib.metadata import PackageNotFoundError
from importlib.metadata import version as package_version

import numpy as np

from bench.liggghts import PeerError, Window

TEMPLATES = 12
"""Radii that the sizes are rounded to."""


def version() -> str | None:
    """Version of the package, or None if it is not installed or finds no CUDA."""
    if importlib.util.find_spec("deme") is None:
        return None
    try:
        import deme  # noqa: F401

        return package_version("deme")
    except (ImportError, OSError, PackageNotFoundError):
        return None


def rounded(radius: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Radii of the templates [m], and the template of each grain: equal bins, each with the mean radius of its grains."""
    low, high = float(radius.min()), float(radius.max())
    number = np.minimum(((radius - low) / max(high - low, 1e-300) * TEMPLATES).astype(int), TEMPLATES - 1)
    there, number = np.unique(number, return_inverse=True)
    return np.array([radius[number == k].mean() for k in range(len(there))]), number


def run(state: dict[str, np.ndarray], width: float, material, step: float, warm: int, steps: int) -> Window:
    """One window on a bed in a square box of ``width`` [m].

    Raises:
        PeerError: DEME refused the scene or the state is not finite at the end.
    """
    import deme

    radii, number = rounded(state["r"])
    top = float(state["x"][:, 2].max()) + 10.0 * float(radii.max())
    try:
        solver = deme.DEMSolver([0])
        solver.SetVerbosity("ERROR")
        stuff = solver.LoadMaterial(
            {"E": material.young_modulus, "nu": material.poisson_ratio, "CoR": material.restitution, "mu": material.friction,
             "Crr": material.rolling_friction}
        )  # fmt: skip
        solver.InstructBoxDomainDimension([0.0, width], [0.0, width], [0.0, top])
        solver.InstructBoxDomainBoundingBC("top_open", stuff)
        mass = material.density * 4.0 / 3.0 * np.pi * radii**3
        templates = [solver.LoadSphereType(float(m), float(r), stuff) for m, r in zip(mass, radii, strict=True)]
        grains = solver.AddClumps([templates[k] for k in number], state["x"].tolist())
        grains.SetVel(state["v"].tolist())
        tracker = solver.Track(grains)
        solver.SetTimeStepSize(step)
        solver.SetGravitationalAcceleration([0.0, 0.0, -9.81])
        solver.Initialize()
        solver.DoDynamicsThenSync(warm * step)
        begin = time.perf_counter()
        solver.DoDynamicsThenSync(steps * step)
        seconds = time.perf_counter() - begin
        speed = np.linalg.norm(np.array(tracker.Velocities()), axis=1)
        pairs = solver.GetNumContacts()
    except RuntimeError as error:
        raise PeerError(f"deme: {error}") from error
    if not np.isfinite(speed).all():
        raise PeerError("deme: the state is not finite")
    kinetic = float(0.5 * (mass[number] * speed**2).sum())
    return Window(seconds, len(number), 2.0 * pairs / len(number), kinetic, 0, float("nan"), float("nan"))
