"""Data files of LAMMPS and LIGGGHTS (``write_data``), of the atom style sphere, which LIGGGHTS calls granular."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np

from warpdem.errors import SceneError
from warpdem.exchange.grains import ForeignGrains
from warpdem.exchange.lammps_dump import BROKEN, opened

STYLES = ("sphere", "granular")
ATOMS = "id type diameter density x y z"
SECTION = re.compile(r"[A-Z][A-Za-z]*(?: [A-Z][A-Za-z]*)*$")


def read_data(path: Path) -> ForeignGrains:
    """Grains of a data file.

    Raises:
        SceneError: it cannot be read, is of another atom style, or has another number of grains than it says.
    """
    try:
        with opened(path) as file:
            lines = [line.rstrip("\n") for line in file]
    except BROKEN as error:
        raise SceneError(f"{path}: cannot be read as a data file ({error})") from error
    sections, head, style = _sections(lines)
    count = next((int(m[1]) for line in head if (m := re.match(r"\s*(\d+)\s+atoms\b", line))), None)
    if count is None or "Atoms" not in sections:
        raise SceneError(f"{path}: is no data file of LAMMPS: a line 'N atoms' or the section Atoms is missing")
    if style and style not in STYLES:
        raise SceneError(f"{path}: its atoms are of the style {style!r}; read are {' and '.join(STYLES)} ({ATOMS})")
    atoms = _table(sections["Atoms"], path, "Atoms")
    if len(atoms) != count:
        raise SceneError(f"{path}: says {count} atoms, and its section Atoms has {len(atoms)}")
    if count and atoms.shape[1] not in (7, 10):
        words = f"its atoms have {atoms.shape[1]} columns; of the style sphere they have 7, or 10"
        raise SceneError(f"{path}: {words} ({ATOMS} ix iy iz)")
    atoms = atoms.reshape(count, -1) if count else np.zeros((0, 7))
    ids = atoms[:, 0].astype(np.int64)
    velocity = spin = None
    if "Velocities" in sections:
        moving = _table(sections["Velocities"], path, "Velocities")
        if moving.shape[1:] != (7,) or sorted(moving[:, 0]) != sorted(atoms[:, 0]):
            raise SceneError(f"{path}: its section Velocities must have a line 'id vx vy vz wx wy wz' for each atom")
        moving = moving[np.argsort(moving[:, 0])][np.argsort(np.argsort(atoms[:, 0]))]
        velocity, spin = moving[:, 1:4], moving[:, 4:7]
    kinds = atoms[:, 1].astype(np.int64)
    return ForeignGrains(atoms[:, 4:7], 0.5 * atoms[:, 2], velocity, spin, ids, kinds, "a data file", ("density",))


def _sections(lines: list[str]) -> tuple[dict[str, list[str]], list[str], str]:
    """Lines of each section, those before the first one, and the style that a comment behind Atoms names."""
    found: dict[str, list[str]] = {}
    head: list[str] = []
    style, now = "", head
    for line in lines[1:]:  # the first is a comment
        text, _, comment = line.partition("#")
        text = text.strip()
        if SECTION.fullmatch(text):
            now = found.setdefault(text, [])
            style = comment.strip() if text == "Atoms" else style
        elif text:
            now.append(text)
    return found, head, style


def _table(lines: list[str], path: Path, section: str) -> np.ndarray:
    try:
        return np.loadtxt(lines, ndmin=2) if lines else np.zeros((0, 7))
    except ValueError as error:
        raise SceneError(f"{path}: its section {section} is no table of numbers ({error})") from error
