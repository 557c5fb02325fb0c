"""What a scene needs: the only place that decides what is compiled, allocated and run, and what is left out."""

import inspect
from dataclasses import dataclass, field
from functools import cached_property
from types import ModuleType

import numpy as np
import warp as wp

from warpdem.kernels import grain
from warpdem.kernels.contact import columns, pairs
from warpdem.kernels.contact.columns import Columns
from warpdem.kernels.contact.dissipation import ENTRY
from warpdem.kernels.field import NUMBERS
from warpdem.kernels.measure.budget import ENERGIES, MOMENTA
from warpdem.kernels.wall import record
from warpdem.model.domain import Domain
from warpdem.scene.models import digest, is_file, model, numbers
from warpdem.scene.motion import frame_chain

SIMD_LANES = 4  # four doubles fill an AVX2 register
WARP_LANES = 32  # a GPU thread takes one contact, and a warp of 32 threads one pack: it reads consecutive memory
LEFT_OUT = "left out  "  # how a line of Plan.explain begins for what the scene does not need


@dataclass(frozen=True)
class Plan:
    """Every switch of the engine, decided once."""

    normal: str
    tangential: str | None
    rolling: str | None
    torsion: bool
    spins: bool
    integrator: str
    turning_frame: bool
    """The frame's axes turn."""
    moving_frame: bool
    """The frame moves at all."""
    meshes: int
    planes: int
    moving: int
    """Wall motions relative to the frame."""
    in_frame: bool
    """Whether the lists look at ways in frame axes: a wall rests there, or none moves."""
    materials: int
    table: bool
    """Coefficients differ between contacts."""
    gap: float
    """How far beyond contact the normal law acts [m]: lists and forces reach that much further."""
    lanes: int
    revolutions: int = 0
    """Cylinder and cone walls."""
    spheres: int = 0
    precision: str = "double"
    period: tuple[float, float, float] = (0.0, 0.0, 0.0)
    """Length of the domain along each periodic axis [m], else 0."""
    lower: tuple[float, float, float] = (0.0, 0.0, 0.0)
    """Lower border along each periodic axis [m]."""
    wall_images: bool = False
    """Walls are looked for from the periodic images of a grain."""
    outlets: int = 0
    """Regions in which grains leave."""
    orientation: bool = False
    """How grains are turned is kept."""
    fields: tuple[tuple[str, str], ...] = ()
    """External fields: model, and the axes it lives in."""
    user_files: tuple[str, ...] = ()
    """Fingerprints of the user's own model files: a file with other contents is another plan."""
    observers: tuple[tuple[str, str], ...] = field(default=(), compare=False)
    """Observers: model, and the axes it reads in; kernels of their own, beside the step."""
    scene_walls: int = 0
    """Walls of the scene when the energy budget is added up, else 0."""
    energy: bool = False
    """The energy budget is added up."""
    momentum: bool = False
    """The momentum budget is added up."""
    flows: int = 0
    """Planes that the flow through is measured at."""
    resident: bool = False
    """Many steps are one captured graph that makes its contact lists itself: how a GPU runs."""
    left_out: dict[str, str] = field(default_factory=dict, compare=False)
    """What is neither compiled nor allocated, with the reason."""

    @property
    def walls(self) -> bool:
        """Whether there are walls."""
        return self.meshes + self.planes + self.revolutions + self.spheres > 0

    @cached_property
    def history(self) -> Columns:
        """What a contact remembers, by name."""
        tangential = model("tangential", self.tangential) if self.tangential else None
        rolling = model("rolling", self.rolling) if self.rolling else None
        return columns.history(model("normal", self.normal), tangential, rolling)

    @property
    def memory(self) -> int:
        """Numbers remembered per contact."""
        return self.history.width

    @property
    def own_history(self) -> tuple[str, ...]:
        """Names of what a contact remembers for its normal law."""
        return columns.own_history(model("normal", self.normal)).names

    @property
    def own_constants(self) -> tuple[str, ...]:
        """Names of the constants of a contact that its normal law adds."""
        return columns.own_coefficients(model("normal", self.normal)).names

    @cached_property
    def coefficients(self) -> Columns:
        """Columns of the table of coefficients."""
        return columns.coefficients(model("normal", self.normal))

    @cached_property
    def constants(self) -> Columns:
        """What is constant of each contact, by name."""
        return columns.stored_constants(model("normal", self.normal), self.rolling is not None)

    @property
    def real(self) -> type:
        """Type of the contact law of grain pairs, its results and its memory."""
        return wp.float32 if self.precision == "mixed" else wp.float64

    @property
    def scheme(self) -> ModuleType:
        """Module of the integrator."""
        return model("integrator", self.integrator)

    @property
    def sums(self) -> dict[str, int]:
        """What is added up per grain at every step, and how many numbers each is."""
        out = {"energies": len(ENERGIES), "wall_work": self.scene_walls} if self.energy else {}
        out |= {"momenta": 6 * len(MOMENTA)} if self.momentum else {}
        return out | ({"flow": 2 * self.flows} if self.flows else {})

    @property
    def frame_rows(self) -> bool:
        """Whether kernels need the frame's own motion: schemes relative to it, fields, places in the laboratory."""
        relative = self.scheme.RELATIVE or self.momentum or self.flows > 0
        return bool(self.fields) or (relative and self.moving_frame)

    @cached_property
    def inertia_factor(self) -> float:
        """Factor from I to the inertia that the rolling model meets: about the contact point for one with a spring."""
        return 3.5 if self.rolling and model("rolling", self.rolling).HISTORY else 1.0

    @property
    def bytes_per_grain(self) -> int:
        """Device memory per grain [B] of a settled bed with 2.8 listed contacts and 0.4 wall places, and room to spare.

        The graph keeps no constants and carries memory over in the room of the forces; its rows have an eighth to spare.
        """
        constants, memories, listed, near = self.constants.width, 2, 4.2, 20 * (4 + 4 + 1)
        if self.resident:
            constants, memories, listed, near = 0, 1, 3.2, 10 * (4 + 4) + 20
        number = 4 if self.precision == "mixed" else 8
        contact = number * (2 * pairs.share_width(self.spins) + memories * self.memory + constants) + 16 + 4 * self.table
        fixed = 8 * grain.WIDTH[self.spins] + 16 + 2 * 24 * (1 + self.moving) + 8 + 4 * 4 + 32 * self.orientation
        contact += number * 2 * ENTRY * self.energy
        fixed += 8 * sum(self.sums.values()) + 8 * (25 + self.scene_walls) * (self.energy and self.walls)
        result = record.RESULT.width if self.rolling else record.FRICTION
        place = 8 * (2 * record.columns(self.history).width + result) + 64 + 12
        walls = 48 + 8 + 0.4 * place if self.walls else 0
        return int(fixed + listed * contact + near + walls)

    def explain(self) -> list[str]:
        """One line per feature: what runs and what is left out, with the reason."""
        runs = [f"normal: {self.normal}"]
        runs += [f"tangential: {self.tangential}"] if self.tangential else []
        runs += [f"rolling: {self.rolling}" + (" with torsion" if self.torsion else "")] if self.rolling else []
        runs += [f"integrator: {self.integrator}" + (" in a moving frame" if self.moving_frame else "")]
        added = [name for name, on in (("energy", self.energy), ("momentum", self.momentum)) if on]
        runs += [f"planes with flow counted at every step: {self.flows}"] if self.flows else []
        runs += [f"budget at every step: {' and '.join(added)}"] if added else []
        runs += [f"external field: {name} in {axes} axes" for name, axes in self.fields]
        runs += ["orientation of the grains"] if self.orientation else []
        runs += [f"observer, at rows of the history: {name} in {axes} axes" for name, axes in self.observers]
        names = ("meshes", "planes", "cylinders and cones", "spheres")
        shapes = dict(zip(names, (self.meshes, self.planes, self.revolutions, self.spheres), strict=True))
        present = ", ".join(f"{count} {shape}" for shape, count in shapes.items() if count)
        runs += [f"walls: {present}, {self.moving} of their motions relative to the frame"]
        runs = runs if self.walls else runs[:-1]
        runs += ["steps as one captured graph, which makes its lists itself"] if self.resident else []
        runs += [f"contacts side by side: {self.lanes}", f"contact history: {8 * self.memory} B per contact"]
        return [f"runs      {line}" for line in runs] + [f"{LEFT_OUT}{k}: {why}" for k, why in self.left_out.items()]


def coefficient_table(scene) -> np.ndarray:
    """Coefficients of every pair of materials, shape (m * m, width of ``coefficient_columns``).

    Pairs that cannot meet (no coefficients given) hold NaN.
    """
    names = list(scene.materials)
    normal, at = model("normal", scene.located(scene.contact.normal)), coefficient_columns(scene)
    table = np.full((len(names), len(names), at.width), np.nan)
    for pair in scene.pairs:
        a, b = (names.index(m) for m in pair.materials)
        of_law = tuple(normal.coefficients(scene.materials[names[a]], scene.materials[names[b]], pair))
        first = len(columns.OF_NORMAL_LAW)
        row = (*of_law[:first], *(getattr(pair, key) for key in columns.OF_PAIR), *of_law[first:])
        table[a, b] = table[b, a] = row
    return table.reshape(-1, at.width)


def coefficient_columns(scene) -> Columns:
    """Columns of ``coefficient_table``, by name."""
    return columns.coefficients(model("normal", scene.located(scene.contact.normal)))


def field_numbers(scene) -> np.ndarray:
    """Parameters of each external field one after the other, filled up with zeros, SI units, shape (f, 12)."""
    return np.array([numbers(one.parameters) for one in scene.fields]).reshape(-1, NUMBERS)


def law_gap(scene, largest: float) -> float:
    """Largest distance beyond contact at which the normal law still acts [m]; 0 for a law of contact alone.

    Args:
        scene: the validated scene.
        largest: radius of the largest grain [m]; R* is at most that at a wall, and half of it between grains.
    """
    gap = getattr(model("normal", scene.located(scene.contact.normal)), "gap", None)
    if gap is None:
        return 0.0
    materials = scene.materials
    radius = (largest if scene.walls else 0.5 * largest,) if len(inspect.signature(gap).parameters) > 3 else ()
    return max((float(gap(*(materials[m] for m in pair.materials), pair, *radius)) for pair in scene.pairs), default=0.0)


def make_plan(
    scene, grain_types: np.ndarray, has_spin: bool, moving: int, resting: int, lanes: int = SIMD_LANES,
    resident: bool = False, largest: float = 0.0,
) -> Plan:  # fmt: skip
    """Decide what ``scene`` needs.

    Args:
        scene: the validated scene.
        grain_types: material index per grain, shape (n,).
        has_spin: whether some grain spins at the start.
        moving: number of wall motions relative to the frame.
        resting: number of wall motions that rest in it.
        lanes: contacts side by side.
        resident: steps run as one captured graph.
        largest: radius of the largest grain that may come [m].
    """
    names = list(scene.materials)
    at = coefficient_columns(scene)
    table = coefficient_table(scene).reshape(len(names), len(names), at.width)
    present = sorted(set(np.unique(grain_types).tolist()))
    others = sorted(set(present) | {names.index(w.material) for w in scene.walls})
    used = np.array([table[a, b] for a in present for b in others]).reshape(-1, at.width)
    left_out = {}
    normal = scene.located(scene.contact.normal)
    tangential: str | None = None if scene.contact.tangential == "none" else scene.located(scene.contact.tangential)
    rolling: str | None = None if scene.contact.rolling == "none" else scene.located(scene.contact.rolling)
    if tangential is None or not np.any(used[:, at.friction] > 0):
        left_out["tangential spring and Coulomb limit"] = (
            "contact.tangential is none" if tangential is None else "every friction coefficient is zero"
        )
        tangential = None
    if rolling is None or not np.any(used[:, at.rolling_friction] > 0):
        left_out["rolling resistance"] = (
            "contact.rolling is none" if rolling is None else "every rolling_friction is zero"
        )
        rolling = None
    spins = bool(tangential or rolling or has_spin)
    if not spins:
        left_out["spins and torques"] = "nothing turns a grain"
    orientation = scene.output.orientation and spins
    if not orientation:
        left_out["orientation of the grains"] = "output.orientation is false" if spins else "nothing turns a grain"
    frame = frame_chain(scene)
    if not frame.turns:
        still = "the frame only shifts" if frame.moves else "the frame never moves"
        left_out["turning of the axes"] = "no frame" if scene.frame is None else still
    if not scene.walls:
        left_out["walls"] = "the scene has none"
    elif moving == 0:
        left_out["wall motion relative to the frame"] = "all walls rest in it"
    fields = tuple((scene.located(one.model), one.axes) for one in scene.fields)
    if not fields:
        left_out["external fields"] = "the scene has none"
    if not scene.observers:
        left_out["observers"] = "the scene has none"
    chosen = [name for name in (normal, tangential, rolling, *(name for name, _ in fields)) if name]
    domain = Domain(scene)
    if not any(domain.period):
        left_out["periodic images"] = "no axis is periodic"
    if not len(domain.boxes):
        left_out["borders and outlets"] = "the scene has none"
    for name, on in (("energy", scene.measures.energy), ("momentum", scene.measures.momentum)):
        if not on:
            left_out[f"{name} budget"] = f"measures.{name} is not asked for"
    if not scene.measures.flow:
        left_out["flow through planes"] = "measures.flow names none"
    one_kind = len(used) == 0 or bool(np.all(used == used[0]))
    if one_kind:
        left_out["table of coefficients"] = "all contacts share one set"
    return Plan(
        normal=normal,
        tangential=tangential,
        rolling=rolling,
        torsion=bool(rolling and scene.contact.torsion),
        spins=spins,
        integrator=scene.engine.integrator,
        turning_frame=frame.turns,
        moving_frame=frame.moves,
        meshes=sum(w.mesh is not None for w in scene.walls),
        planes=sum(w.plane is not None for w in scene.walls),
        revolutions=sum(w.cylinder is not None or w.cone is not None for w in scene.walls),
        spheres=sum(w.sphere is not None for w in scene.walls),
        moving=moving,
        in_frame=moving == 0 or resting > 0 or any(domain.period),
        materials=len(names),
        table=not one_kind,
        gap=law_gap(scene, largest),
        lanes=lanes,
        resident=resident,
        fields=fields,
        user_files=tuple(digest(name) for name in chosen if is_file(name)),
        precision=scene.engine.precision,
        period=domain.period,
        lower=domain.lower,
        outlets=len(domain.boxes),
        orientation=orientation,
        observers=tuple((scene.located(one.model), one.axes) for one in scene.observers),
        scene_walls=len(scene.walls) if scene.measures.energy else 0,
        energy=scene.measures.energy,
        momentum=scene.measures.momentum,
        flows=len(scene.measures.flow),
        left_out=left_out,
    )
