"""What a script sets up: regions, fixes, and the time at which each of them begins and ends."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path

from warpdem.errors import SceneError
from warpdem.exchange.liggghts.script import Command, read_script

NOT_NEEDED = frozenset(
    "atom_style atom_modify newton communicate comm_modify neighbor neigh_modify processors compute thermo_style thermo_modify "
    "group echo log print shell timer restart write_restart reset_timestep undump dump_modify pair_coeff hard_particles "
    "modify_timing partitioner_style clear".split()
)
"""Commands that need no counterpart: a scene has no such setting, or does by itself what they ask for."""
FIXES_NOT_NEEDED = ("nve", "multisphere", "check/timestep", "printFluid", "print", "ave/", "continuum", "enforce2d")
"""Fixes that need none, by the begin of their style."""


@dataclass
class Fix:
    """A fix of a script.

    Attributes:
        name: its id.
        style: such as mesh/surface.
        words: what follows the style.
        command: the line.
        start: time at which it is defined [s].
        until: time at which it is taken off [s]; None: never.
        used: whether a table of the scene comes of it.
    """

    name: str
    style: str
    words: tuple[str, ...]
    command: Command
    start: float
    until: float | None = None
    used: bool = False

    def after(self, key: str, count: int = 1) -> tuple[str, ...] | None:
        """The ``count`` words behind the word ``key``, None where it is not there.

        Raises:
            SceneError: there are fewer.
        """
        if key not in self.words:
            return None
        at = self.words.index(key) + 1
        if len(self.words) < at + count:
            raise SceneError(f"{self.command.place}: {key} needs {count} more words")
        return self.words[at : at + count]

    def numbers(self, key: str, count: int = 1) -> list[float] | None:
        """The same as numbers."""
        words = self.after(key, count)
        return None if words is None else numbers(words, self.command)


@dataclass
class Deck:
    """A script as data.

    Attributes:
        path: the script.
        fixes: all of them, in their order, those taken off too.
        regions: words behind the name of each region, by name.
        boundary: p, f, s or m of the borders of each axis.
        domain: name of the region of create_box.
        pair_style: words of pair_style.
        timestep: [s].
        end: time at which the last run ends [s].
        frames, rows: steps between dumps, and between lines of thermo output; 0: not given.
        start_files: data and restart files that it reads.
        notes: what was not converted, and what is other.
    """

    path: Path
    fixes: list[Fix] = field(default_factory=list)
    regions: dict[str, tuple[str, ...]] = field(default_factory=dict)
    boundary: list[str] = field(default_factory=lambda: ["p", "p", "p"])
    domain: str | None = None
    pair_style: tuple[str, ...] = ()
    timestep: float = 0.0
    end: float = 0.0
    frames: int = 0
    rows: int = 0
    start_files: list[Command] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)

    def of_style(self, *begins: str) -> list[Fix]:
        """Fixes whose style begins so, in order; they count as used."""
        found = [fix for fix in self.fixes if fix.style.startswith(begins)]
        for fix in found:
            fix.used = True
        return found

    def unused(self) -> list[str]:
        """Notes on fixes that no table comes of."""
        left = (fix for fix in self.fixes if not fix.used and not fix.style.startswith(FIXES_NOT_NEEDED))
        return [f"{fix.command}: not converted" for fix in left]


def numbers(words: Sequence[str], command: Command) -> list[float]:
    """Words as numbers.

    Raises:
        SceneError: one is none.
    """
    try:
        found = [float(word) for word in words]
    except ValueError:
        raise SceneError(f"{command.place}: {' '.join(words)!r} are no numbers that are known before the run") from None
    if not all(map(math.isfinite, found)):
        raise SceneError(f"{command.place}: {' '.join(words)!r} are not finite")
    return found


def read_deck(path: Path) -> Deck:
    """What a script sets up.

    Raises:
        SceneError: it cannot be read, is in other units than si, or a command lacks words.
    """
    commands, notes = read_script(path)
    deck = Deck(path, notes=notes)
    for command in commands:
        words = command.words
        try:
            _take(deck, command, words)
        except IndexError:
            raise SceneError(f"{command}: lacks words, or is no command of LIGGGHTS") from None
    if not deck.pair_style and not deck.fixes:
        raise SceneError(f"{path}: is no script of LIGGGHTS: it has neither pair_style nor a fix")
    return deck


def _take(deck: Deck, command: Command, words: tuple[str, ...]) -> None:
    """Take up a command."""
    match words[0]:
        case "units" if words[1] != "si":
            raise SceneError(f"{command.place}: units {words[1]}: only scripts in si are converted")
        case "units":
            pass
        case "boundary":
            deck.boundary = list(words[1:4])
        case "region":
            deck.regions[words[1]] = words[2:]
        case "create_box":
            deck.domain = words[2]
        case "pair_style":
            deck.pair_style = words[1:]
        case "timestep":
            deck.timestep = numbers(words[1:2], command)[0]
        case "fix":
            deck.fixes.append(Fix(words[1], words[3], words[4:], command, deck.end))
        case "unfix":
            for fix in deck.fixes:
                if fix.name == words[1] and fix.until is None:
                    fix.until = deck.end
        case "run":
            steps = numbers(words[1:2], command)[0]
            if not deck.timestep:
                raise SceneError(f"{command.place}: run without a timestep before it")
            deck.end = steps * deck.timestep if "upto" in words else deck.end + steps * deck.timestep
        case "dump" if words[3].startswith(("custom", "atom")):
            deck.frames = deck.frames or int(numbers(words[4:5], command)[0])
        case "dump":
            pass
        case "thermo":
            deck.rows = int(numbers(words[1:2], command)[0])
        case "read_data" | "read_restart" | "read_dump":
            deck.start_files.append(command)
        case other if other not in NOT_NEEDED:
            deck.notes.append(f"{command}: not converted")
