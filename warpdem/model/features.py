"""What a scene may need, as frozen structs: what is compiled, allocated and run goes by them alone."""

from dataclasses import dataclass, field
from functools import cached_property
from types import ModuleType

import warp as wp

from warpdem.kernels import grain
from warpdem.kernels.contact import columns, pairs
from warpdem.kernels.contact.columns import Columns
from warpdem.kernels.contact.dissipation import LOSSES, impulses
from warpdem.kernels.measure.budget import ENERGIES, MOMENTA_AT, wall_entry
from warpdem.kernels.wall import record
from warpdem.kernels.wall.candidates import MET
from warpdem.scene.models import model
from warpdem.scene.user_models import parts_of

LEFT_OUT = "left out  "  # how a line of Features.explain begins for what the scene does not need


@dataclass(frozen=True)
class ContactFeatures:
    """Contact law between grains, and between a grain and a wall."""

    normal: str
    tangential: str | None
    rolling: str | None
    torsion: bool
    spins: bool
    """Grains have spins and torques."""
    materials: int
    table: bool
    """Coefficients differ between contacts."""
    gap: float
    """How far beyond contact the normal law or a liquid bridge acts [m]: lists have a cutoff that much larger."""
    dry_gap: float | None = None
    """How far beyond contact the normal law itself acts [m], if not as far: forces reach further only of a bridge."""
    twisting: str | None = None
    clumps: bool = False
    """Some grains are members of clumps."""
    apart: bool = False
    """Some materials that meet do not touch: lists leave them out."""

    @property
    def force_gap(self) -> float:
        """How far beyond contact a contact without a bridge has a force [m]."""
        return self.gap if self.dry_gap is None else self.dry_gap

    @property
    def wet(self) -> bool:
        """There is a law of liquid bridges."""
        return len(parts_of(self.normal)) > 1

    @property
    def pair_force_width(self) -> int:
        """Numbers of a pair force on one grain."""
        return pairs.pair_force_width(self.spins, self.wet)

    @cached_property
    def history(self) -> Columns:
        """What a contact remembers, by name."""
        tangential = model("tangential", self.tangential) if self.tangential else None
        rolling = model("rolling", self.rolling) if self.rolling else None
        twisting = model("twisting", self.twisting) if self.twisting else None
        return columns.history(model("normal", self.normal), tangential, rolling, twisting)

    @property
    def moments(self) -> bool:
        """Contacts give torques beside those of their forces."""
        return bool(self.rolling or self.twisting)

    @cached_property
    def own_history(self) -> tuple[str, ...]:
        """Names of what a contact remembers for its normal law."""
        return columns.own_history(model("normal", self.normal)).names

    @cached_property
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

    @cached_property
    def inertia_factor(self) -> float:
        """Factor from I to the inertia that the rolling model meets: about the contact point for one with a spring."""
        return columns.inertia_factor(model("rolling", self.rolling) if self.rolling else None)


@dataclass(frozen=True)
class FrameFeatures:
    """Motion of the frame."""

    rotates: bool
    """The axes of the frame rotate."""
    moves: bool
    """The frame moves at all."""
    tracked: bool
    """Displacements in frame axes decide when lists are rebuilt: a wall rests there, none moves, or the domain is periodic."""


@dataclass(frozen=True)
class WallFeatures:
    """Walls by shape, and how many of them move."""

    meshes: int
    moving: int
    """Wall motions relative to the frame."""
    shapes: tuple[str, ...] = ()
    """Analytic shapes among the walls, by their file in ``kernels/wall/``."""
    images: bool = False
    """Walls act at their periodic images too."""
    conveying: bool = False
    """Surfaces of walls move along themselves."""
    dynamic: int = 0
    """Walls that move by the load on them."""
    bodies: int = 0
    """Those of them with six degrees of freedom."""
    free: int = 0
    """Those of them that have a mass: no servos."""

    @property
    def present(self) -> bool:
        """Whether there are walls."""
        return self.meshes > 0 or bool(self.shapes)


@dataclass(frozen=True)
class DomainFeatures:
    """Borders of the domain and outlets."""

    period: tuple[float, float, float] = (0.0, 0.0, 0.0)
    """Length of the domain along each periodic axis [m], else 0."""
    lower: tuple[float, float, float] = (0.0, 0.0, 0.0)
    """Lower border along each periodic axis [m]."""
    outlets: int = 0
    """Regions in which grains leave."""
    kinds: tuple[int, ...] = ()
    """Kinds of shapes among these, as of ``kernels.step.region``."""
    placed: bool = False
    """Some of them are at rest in the laboratory, or carried by a wall."""

    @property
    def periodic(self) -> bool:
        """Whether some axis is periodic."""
        return any(self.period)


@dataclass(frozen=True)
class BackendFeatures:
    """How steps are computed: integrator, precision and device."""

    integrator: str
    lanes: int
    """SIMD width: contacts that are evaluated side by side."""
    precision: str = "double"
    resident: bool = False
    """Many steps are one captured graph that makes its contact lists itself: how a GPU runs."""
    ranks: bool = False
    """The grains are dealt out to several processes."""

    @property
    def real(self) -> type:
        """Type of the contact law of grain pairs, its results and its history."""
        return wp.float32 if self.precision == "mixed" else wp.float64

    @property
    def scheme(self) -> ModuleType:
        """Module of the integrator."""
        return model("integrator", self.integrator)


@dataclass(frozen=True)
class MeasureFeatures:
    """What is added up, kept or read for results, beside the motion itself."""

    orientation: bool = False
    """Orientations of the grains are integrated."""
    energy: bool = False
    """The energy budget is added up."""
    losses: tuple[str, ...] = ()
    """LOSSES of the normal law when the energy budget is added up."""
    momentum: bool = False
    """The momentum budget is added up."""
    scene_walls: int = 0
    """Walls of the scene when the energy budget is added up, else 0."""
    flows: int = 0
    """Planes that the flow through is measured at."""
    wear: bool = False
    """What wears walls is added up."""
    residence: bool = field(default=False, compare=False)
    """Grains that leave are taken down, on the host."""
    observers: tuple[tuple[str, str], ...] = field(default=(), compare=False)
    """Observers: model, and the axes it reads in; kernels of their own, beside the step."""

    @property
    def sums(self) -> dict[str, int]:
        """What is added up per grain at every step, and how many numbers each is."""
        out = {"energies": len(ENERGIES) + len(self.losses), "wall_work": self.scene_walls} if self.energy else {}
        out |= {"momenta": MOMENTA_AT.width} if self.momentum else {}
        return out | ({"flow": 2 * self.flows} if self.flows else {})

    @property
    def of_contacts(self) -> tuple[str, ...]:
        """What contacts between grains lose, of which the energy budget adds up each."""
        return (*LOSSES, *self.losses) if self.energy else ()


@dataclass(frozen=True)
class Features:
    """Every switch of the engine, decided once."""

    contact: ContactFeatures
    frame: FrameFeatures
    walls: WallFeatures
    domain: DomainFeatures
    backend: BackendFeatures
    measures: MeasureFeatures = MeasureFeatures()
    fields: tuple[tuple[str, str], ...] = ()
    """External fields: model, and the axes it lives in."""
    user_files: tuple[str, ...] = ()
    """Digests of the user's own model files: a file with other contents needs other kernels."""
    left_out: dict[str, str] = field(default_factory=dict, compare=False)
    """What is neither compiled nor allocated, with the reason."""

    @cached_property
    def impulses(self) -> Columns:
        """What contacts between grains keep for the energy budget from one force call to the next, by name."""
        laws = self.contact
        named = (("tangential", laws.tangential), ("rolling", laws.rolling), ("twisting", laws.twisting))
        others = (model(kind, name) if name else None for kind, name in named)
        return impulses(model("normal", laws.normal), *others) if self.measures.energy else Columns(())

    @property
    def memory(self) -> int:
        """Numbers that a contact between grains keeps from one force call to the next: its history and ``impulses``."""
        return self.contact.history.width + self.impulses.width

    @property
    def frame_rows(self) -> bool:
        """Whether kernels need the frame's own motion: schemes relative to it, fields, places in the laboratory."""
        relative = self.backend.scheme.RELATIVE or self.measures.momentum or self.measures.flows > 0
        return bool(self.fields) or (relative and self.frame.moves)

    @property
    def bytes_per_grain(self) -> int:
        """Device memory per grain [B] of a settled bed with 2.8 listed contacts 0.4 wall contact points, spare capacity.

        The graph keeps no constants and carries the history over in the memory of the forces; its lists have 1/8 to spare.
        """
        law, walls, measures = self.contact, self.walls, self.measures
        constants, memories, listed, near = law.constants.width, 2, 4.2, 20 * (4 + 4 + 1)
        if self.backend.resident:
            constants, memories, listed, near = 0, 1, 3.2, 10 * (4 + 4) + 20
        number = 4 if self.backend.precision == "mixed" else 8
        contact = number * (2 * law.pair_force_width + memories * self.memory + constants) + 16 + 4 * law.table
        fixed = 8 * grain.WIDTH[law.spins] + 16 + 2 * 24 * (1 + walls.moving) + 8 + 4 * 4 + 32 * measures.orientation
        fixed += 24 * law.wet  # films
        fixed += 2 * 8  # allowances of two outer lists
        at_walls = wall_entry(measures.losses).width + measures.scene_walls
        fixed += 8 * sum(measures.sums.values()) + 8 * at_walls * (measures.energy and walls.present)
        result = record.RESULT.width if law.moments else record.FRICTION
        contact_point = 8 * (2 * record.columns(law.history).width + result) + 64 + 32 + 12
        met = 0 if self.backend.resident else 1.5 * 4 * MET
        beside_walls = 48 + 8 + 0.4 * contact_point + met if walls.present else 0
        return int(fixed + listed * contact + near + beside_walls)

    def explain(self) -> list[str]:
        """One line per feature: what runs and what is left out, with the reason."""
        contact, walls, backend, measures = self.contact, self.walls, self.backend, self.measures
        normal, *liquid = parts_of(contact.normal)
        runs = [f"normal: {normal}"]
        runs += [f"liquid: {name}, films of the grains in whole counts" for name in liquid]
        runs += [f"tangential: {contact.tangential}"] if contact.tangential else []
        runs += [f"rolling: {contact.rolling}" + (" with torsion" if contact.torsion else "")] if contact.rolling else []
        runs += [f"twisting: {contact.twisting}"] if contact.twisting else []
        runs += [f"integrator: {backend.integrator}" + (" in a moving frame" if self.frame.moves else "")]
        added = [name for name, on in (("energy", measures.energy), ("momentum", measures.momentum)) if on]
        runs += [f"planes with flow counted at every step: {measures.flows}"] if measures.flows else []
        runs += ["wear of walls, added up at every step"] if measures.wear else []
        runs += [f"budget at every step: {' and '.join(added)}"] if added else []
        runs += [f"external field: {name} in {axes} axes" for name, axes in self.fields]
        runs += ["materials that do not touch, left out of the lists"] if contact.apart else []
        runs += ["orientation of the grains"] if measures.orientation else []
        runs += [f"observer, at rows of the history: {name} in {axes} axes" for name, axes in measures.observers]
        present = [f"{walls.meshes} meshes"] * (walls.meshes > 0) + [f"of the shape {name}" for name in walls.shapes]
        moving = f"{walls.moving} of their motions relative to the frame"
        runs += [f"walls: {', '.join(present)}, {moving}"] if walls.present else []
        runs += ["surface velocity of walls"] if walls.conveying else []
        runs += [f"walls that move by the load on them (servos, free walls): {walls.dynamic}"] if walls.dynamic else []
        runs += ["exchange of grains between processes at every step"] if backend.ranks else []
        runs += ["steps as one captured graph, which makes its lists itself"] if backend.resident else []
        runs += [f"contacts side by side: {backend.lanes}", f"contact history: {8 * self.memory} B per contact"]
        return [f"runs      {line}" for line in runs] + [f"{LEFT_OUT}{k}: {why}" for k, why in self.left_out.items()]
