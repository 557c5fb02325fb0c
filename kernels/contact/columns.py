"""What the numbers of a contact are, by name: coefficients of two materials, constants of one contact, contact history.

Kernels hold them in vectors and arrays hold them side by side. The order stands here and nowhere else: kernels read
``c[wp.static(at.friction)]``, the host ``table[:, at.friction]``. A contact law adds its own numbers by what its file
declares; they come last, so that a law without any has the layout, and the bits, that it had before.

    normal law    COEFFICIENTS = {name: unit}    of two materials, and of each contact what its ``constants`` makes of them
                  HISTORY = {name: unit}         scalars that a contact remembers; they do not rotate with the axes
                  LOSSES = (name, ...)           of ``LOSSES``: what it loses beside its dashpot, for the energy budget
    rolling law   HISTORY                        whether a contact remembers the rolling spring
    any law       PAIR = {key: PairKey}          keys of ``[[pairs]]`` that the law reads
"""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from types import ModuleType
from typing import NamedTuple

import warp as wp

OF_NORMAL_LAW = {"stiffness": "of the law", "damping": "of the law", "shear": "-", "shear_damping": "-"}
"""What ``coefficients`` of a normal law returns first: what its ``constants`` makes the two of a contact from, k_t/k_n and
gamma_t/gamma_n."""
OF_PAIR = {"friction": "-", "rolling_friction": "-", "rolling_damping": "-"}
"""Keys of ``[[pairs]]`` that are coefficients of every scene."""
OF_CONTACT = ("stiffness", "damping", "inverse_mass")
"""Constants of one contact under any normal law: what its ``constants`` returns first, and 1/m* [1/kg]."""
LOAD = "load"
"""Column of the contact history that keeps the Coulomb load [N] of the last force call, for readers: where the normal law may
have a load of its own, and there is friction that goes by it."""
TWIST = "twist"
"""Column of the contact history of a twisting law: its spring [rad]."""
VECTORS = {"spring": "m", "angle": "rad"}
"""Vectors of the contact history: tangential and rolling spring; they rotate with the axes and with the normal."""
LOSSES = ("adhesion", "plasticity", "liquid")
"""What a normal law may lose energy by beside its dashpot: columns of the energy budget of a scene whose law declares them."""


class PairKey(NamedTuple):
    """A key of ``[[pairs]]`` that a contact law reads."""

    unit: str
    default: float | None
    """None: the scene must give it."""
    text: str
    """Description, for the schema and for messages."""
    positive: bool = False
    """Whether 0 is refused; a negative number always is."""


@dataclass(frozen=True)
class Columns:
    """Names of the numbers of a vector, in their order; ``at.NAME`` is the first (or only) one of a name.

    Args:
        sizes: name, and how many numbers it takes: 1, or 3 for a vector.
    """

    sizes: tuple[tuple[str, int], ...]

    def __getattr__(self, name: str) -> int:
        if name.startswith("__"):
            raise AttributeError(name)
        return self._range(name)[0]

    def __contains__(self, name: str) -> bool:
        return name in self.names

    def _range(self, name: str) -> tuple[int, int]:
        start = 0
        for known, size in self.sizes:
            if known == name:
                return start, start + size
            start += size
        raise AttributeError(f"no column {name!r}; there are {', '.join(self.names)}")

    @property
    def names(self) -> tuple[str, ...]:
        """All names."""
        return tuple(name for name, _ in self.sizes)

    @property
    def width(self) -> int:
        """Numbers in all."""
        return sum(size for _, size in self.sizes)

    def of(self, name: str) -> int | slice:
        """Index of a name along the last axis of an array: a slice for a vector."""
        start, stop = self._range(name)
        return start if stop - start == 1 else slice(start, stop)

    def and_(self, other: "Columns") -> "Columns":
        """These, followed by ``other``."""
        return Columns(self.sizes + other.sizes)

    def vector(self, real) -> type:
        """Vector that holds them in ``real``; of one unused number where there is none."""
        return wp.types.vector(max(self.width, 1), real)


def scalars(names: Iterable[str]) -> Columns:
    """One number per name."""
    return Columns(tuple((name, 1) for name in names))


def coefficient_row(of_law: Sequence[float], of_pair: Mapping[str, float]) -> tuple[float, ...]:
    """A row of the table of coefficients.

    Args:
        of_law: what ``coefficients`` of the normal law returns.
        of_pair: values of the keys ``OF_PAIR``.
    """
    first = len(OF_NORMAL_LAW)
    return (*of_law[:first], *(of_pair[key] for key in OF_PAIR), *of_law[first:])


def own_coefficients(normal: ModuleType) -> Columns:
    """Coefficients that a normal law adds to those of every law."""
    return scalars(getattr(normal, "COEFFICIENTS", {}))


def own_history(normal: ModuleType) -> Columns:
    """Scalars that a contact remembers for its normal law."""
    return scalars(getattr(normal, "HISTORY", {}))


def losses(normal: ModuleType) -> tuple[str, ...]:
    """What a normal law loses energy by beside its dashpot, of ``LOSSES``."""
    return tuple(getattr(normal, "LOSSES", ()))


def coefficients(normal: ModuleType) -> Columns:
    """Columns of the table of coefficients per pair of materials."""
    return scalars([*OF_NORMAL_LAW, *OF_PAIR]).and_(own_coefficients(normal))


def constants(normal: ModuleType) -> Columns:
    """What does not change of one contact, for its normal law: ``OF_CONTACT``, then the law's own."""
    return scalars(OF_CONTACT).and_(own_coefficients(normal))


def inertia_factor(rolling: ModuleType | None) -> float:
    """Factor from I to the inertia that a rolling model meets: about the contact point, 3.5 I, for one with a spring [-]."""
    return 3.5 if rolling is not None and rolling.HISTORY else 1.0


def stored_constants(normal: ModuleType, rolling: bool) -> Columns:
    """What is stored per contact instead of being computed at each step; with a rolling law also R* [m] and the inertia."""
    return constants(normal).and_(scalars(["radius", "inertia"] if rolling else []))


def declares_own(normal: ModuleType) -> bool:
    """Whether a normal law declares numbers of its own: then it also says what its Coulomb load is."""
    return hasattr(normal, "COEFFICIENTS") or hasattr(normal, "HISTORY")


def history(
    normal: ModuleType, tangential: ModuleType | None, rolling: ModuleType | None, twisting: ModuleType | None = None
) -> Columns:
    """Contact history: the springs of the laws that have one, ``LOAD``, ``TWIST``, then the normal law's own scalars."""
    rolls = rolling is not None and bool(rolling.HISTORY)
    vectors = VECTORS if rolls else ["spring"] if tangential is not None else []
    load = [LOAD] if declares_own(normal) and tangential is not None else []
    twist = [TWIST] if twisting is not None else []
    return Columns(tuple((name, 3) for name in vectors)).and_(scalars([*load, *twist])).and_(own_history(normal))


def pair_keys(module: ModuleType | None) -> Mapping[str, PairKey]:
    """Keys of ``[[pairs]]`` that a law reads beside those of every scene."""
    return {key: PairKey(*entry) for key, entry in getattr(module, "PAIR", {}).items()}
