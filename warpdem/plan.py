"""What a scene needs: the only place that decides what is compiled, allocated and run, and what is left out."""

import importlib
import pkgutil
from dataclasses import dataclass, field
from functools import cached_property
from types import ModuleType

import numpy as np

from warpdem import kernels
from warpdem.errors import SceneError
from warpdem.kernels import grain, law, pairs

SIMD_LANES = 4  # four doubles fill an AVX2 register; a GPU thread takes one contact


def model_names(role: str) -> list[str]:
    """Names of the models of a role: the files of ``kernels/<role>/``."""
    package = importlib.import_module(f"{kernels.__name__}.{role}")
    return sorted(m.name for m in pkgutil.iter_modules(package.__path__))


def model(role: str, name: str) -> ModuleType:
    """The module of one model.

    Raises:
        SceneError: if there is no such file.
    """
    if name not in model_names(role):
        raise SceneError(f"contact.{role} = {name!r}: there is no such model; allowed: {', '.join(model_names(role))}")
    return importlib.import_module(f"{kernels.__name__}.{role}.{name}")


@dataclass(frozen=True)
class Plan:
    """Every switch of the engine, decided once."""

    normal: str
    tangential: str | None
    rolling: str | None
    torsion: bool
    spins: bool
    turning_frame: bool
    meshes: int
    planes: int
    moving: int
    """Wall motions relative to the frame."""
    materials: int
    table: bool
    """Coefficients differ between contacts."""
    lanes: int
    left_out: dict[str, str] = field(default_factory=dict, compare=False)
    """What is neither compiled nor allocated, with the reason."""

    @property
    def walls(self) -> bool:
        """Whether there are walls."""
        return self.meshes + self.planes > 0

    @cached_property
    def memory(self) -> int:
        """Numbers remembered per contact."""
        if self.rolling and model("rolling", self.rolling).HISTORY:
            return 6
        return 3 if self.tangential else 0

    @cached_property
    def lag(self) -> float:
        """Factor from I to the inertia that the rolling model meets: about the contact point for one with a spring."""
        return 3.5 if self.rolling and model("rolling", self.rolling).HISTORY else 1.0

    @property
    def bytes_per_grain(self) -> int:
        """Device memory per grain [B] at 2.5 listed contacts and 6.5 near partners, the figures of a settled bed."""
        constants = 4 if self.rolling else 2
        contact = 8 * (2 * pairs.share_width(self.spins) + 2 * self.memory + constants) + 16 + 4 * self.table
        fixed = 8 * grain.WIDTH[self.spins] + 16 + 2 * 24 * (1 + self.moving) + 8 + 4 * 4
        return int(fixed + 2.5 * contact + 6.5 * (4 + 4 + 4 + 1))

    def explain(self) -> list[str]:
        """One line per feature: what runs and what is left out, with the reason."""
        runs = [f"normal: {self.normal}"]
        runs += [f"tangential: {self.tangential}"] if self.tangential else []
        runs += [f"rolling: {self.rolling}" + (" with torsion" if self.torsion else "")] if self.rolling else []
        runs += ["rotating frame: exact drift"] if self.turning_frame else []
        runs += [f"walls: {self.meshes} meshes, {self.planes} planes, {self.moving} of their motions relative to the frame"]
        runs = runs if self.walls else runs[:-1]
        runs += [f"contacts side by side: {self.lanes}", f"memory per contact: {8 * self.memory} B"]
        return [f"runs      {line}" for line in runs] + [f"left out  {k}: {why}" for k, why in self.left_out.items()]


def coefficient_table(scene) -> np.ndarray:
    """Coefficients of every pair of materials, shape (m * m, 7), columns as in ``kernels.law.COEFFICIENTS``.

    Pairs that cannot meet (no coefficients given) hold NaN.
    """
    names = list(scene.materials)
    normal = model("normal", scene.contact.normal)
    table = np.full((len(names), len(names), len(law.COEFFICIENTS)), np.nan)
    for pair in scene.pairs:
        a, b = (names.index(m) for m in pair.materials)
        base = normal.coefficients(scene.materials[names[a]], scene.materials[names[b]], pair)
        row = (*base, pair.friction, pair.rolling_friction, pair.rolling_damping)
        table[a, b] = table[b, a] = row
    return table.reshape(-1, len(law.COEFFICIENTS))


def make_plan(scene, grain_types: np.ndarray, has_spin: bool, moving: int, lanes: int = SIMD_LANES) -> Plan:
    """Decide what ``scene`` needs.

    Args:
        scene: the validated scene.
        grain_types: material index per grain, shape (n,).
        has_spin: whether some grain spins at the start.
        moving: number of wall motions relative to the frame.
        lanes: contacts side by side.
    """
    names = list(scene.materials)
    table = coefficient_table(scene).reshape(len(names), len(names), -1)
    present = sorted(set(np.unique(grain_types).tolist()))
    others = sorted(set(present) | {names.index(w.material) for w in scene.walls})
    used = np.array([table[a, b] for a in present for b in others]).reshape(-1, len(law.COEFFICIENTS))
    left_out = {}
    tangential: str | None = None if scene.contact.tangential == "none" else scene.contact.tangential
    rolling: str | None = None if scene.contact.rolling == "none" else scene.contact.rolling
    if tangential is None or not np.any(used[:, 4] > 0):
        left_out["tangential spring and Coulomb limit"] = (
            "contact.tangential is none" if tangential is None else "every friction coefficient is zero"
        )
        tangential = None
    if rolling is None or not np.any(used[:, 5] > 0):
        left_out["rolling resistance"] = (
            "contact.rolling is none" if rolling is None else "every rolling_friction is zero"
        )
        rolling = None
    spins = bool(tangential or rolling or has_spin)
    if not spins:
        left_out["spins and torques"] = "nothing turns a grain"
    turning = scene.frame is not None and scene.frame.max_rate() > 0.0
    if not turning:
        left_out["turning of the axes"] = "no frame" if scene.frame is None else "the frame's rate is zero"
    if not scene.walls:
        left_out["walls"] = "the scene has none"
    elif moving == 0:
        left_out["wall motion relative to the frame"] = "all walls rest in it"
    one_kind = len(used) == 0 or bool(np.all(used == used[0]))
    if one_kind:
        left_out["table of coefficients"] = "all contacts share one set"
    return Plan(
        normal=scene.contact.normal,
        tangential=tangential,
        rolling=rolling,
        torsion=bool(rolling and scene.contact.torsion),
        spins=spins,
        turning_frame=turning,
        meshes=sum(w.mesh is not None for w in scene.walls),
        planes=sum(w.plane is not None for w in scene.walls),
        moving=moving,
        materials=len(names),
        table=not one_kind,
        lanes=lanes,
        left_out=left_out,
    )
