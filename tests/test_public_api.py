"""Everything public says what it is: docstrings with shapes and units, errors with what raises them."""

import dataclasses
import inspect
import re
import typing
from pathlib import Path

import numpy as np
import pytest
from pydantic import BaseModel

import warpdem
from warpdem.core import snapshot
from warpdem.measure import observers, run_readings

NAMES = [name for name in warpdem.__all__ if name != "__version__"]
DRAWING = ("picture", "plot", "render")
"""Imported by what asks for them: their libraries take seconds."""
CLASSES = [thing for name in NAMES if name not in DRAWING and inspect.isclass(thing := getattr(warpdem, name))]
READINGS = [run_readings.RunReadings, observers.Particles, observers.Contacts, snapshot.WallLoad]
"""What ``Simulation`` hands out."""
WITHOUT_UNIT = {"id", "type", "group", "i", "j"}


def own_members(cls) -> list[tuple[str, object]]:
    """Public functions, class methods and properties that a class of this package defines."""
    found = []
    for name, thing in vars(cls).items():
        thing = thing.__func__ if isinstance(thing, (classmethod, staticmethod)) else thing
        if not name.startswith("_") and (inspect.isfunction(thing) or isinstance(thing, property)):
            found.append((f"{cls.__name__}.{name}", thing))
    return found


FUNCTIONS = [name for name in NAMES if name in DRAWING or getattr(warpdem, name) not in CLASSES]
MEMBERS = dict(member for cls in (*CLASSES, *READINGS) for member in own_members(cls))


@pytest.mark.parametrize("name", NAMES)
def test_public_name_has_a_docstring_of_its_own(name):
    assert inspect.cleandoc(getattr(warpdem, name).__doc__ or "") not in ("", BaseModel.__doc__)


@pytest.mark.parametrize("name", [*FUNCTIONS, *MEMBERS])
def test_public_function_says_what_it_gives(name):
    """Arrays with their shape and unit; arguments that take more than a look at their name are listed."""
    thing = MEMBERS.get(name) or getattr(warpdem, name)
    words = inspect.getdoc(thing) or ""
    assert words, name
    function = thing.fget if isinstance(thing, property) else thing
    returned = typing.get_type_hints(function).get("return")
    if returned is np.ndarray:
        assert re.search(r"shapes? \(", words), f"{name}: no shape"
        if name.split(".")[-1] not in WITHOUT_UNIT:
            assert re.search(r"\[[^\]]+\]", words) or "in its unit" in words or "quaternion" in words, f"{name}: no unit"
    arguments = [p for p in inspect.signature(function).parameters if p not in ("self", "cls")]
    if len(arguments) > 2:
        for argument in arguments:
            assert re.search(rf"^\s+[*]*{argument}: ", words, re.MULTILINE), f"{name}: argument {argument} is not described"


@pytest.mark.parametrize("cls", [cls for cls in READINGS if dataclasses.is_dataclass(cls)], ids=lambda cls: cls.__name__)
def test_columns_have_shape_and_unit(cls):
    """The string below a field, or the class's own for the two ids of a contact."""
    source = inspect.getsource(cls)
    for field in dataclasses.fields(cls):
        if field.name in WITHOUT_UNIT:
            continue
        below = re.search(rf'\n    {field.name}: [^\n]*\n    """(.*?)"""', source, re.DOTALL)
        assert below, f"{cls.__name__}.{field.name} has no docstring"
        if field.name == "normal":
            continue  # a unit vector
        assert re.search(r"\[[^\]]+\]", below[1]), f"{cls.__name__}.{field.name}: no unit"


def test_particles_are_copies_that_nobody_else_holds():
    """A caller may write into what it was given."""
    material = {"density": 2500, "young_modulus": 1e7, "poisson_ratio": 0.3}
    scene = warpdem.Scene.model_validate(
        {
            "materials": {"g": material},
            "contact": {"tangential": "none"},
            "pairs": [{"materials": ["g", "g"], "restitution": 0.5}],
            "grains": [{"material": "g", "positions": [[0, 0, 0], [0, 0, 0.01]], "radius": 1e-3}],
            "time": {"end": 1.0, "step": 1e-5, "max_speed": 0.01},
        }
    )
    sim = warpdem.Simulation(scene, device="cpu", threads=1)
    for name, thing in own_members(observers.Particles):
        name = name.split(".")[1]
        if isinstance(thing, property) and name not in ("orientation", "liquid"):  # which this run does not keep
            getattr(sim.particles, name)[:] = 7
            assert not np.any(getattr(sim.particles, name) == 7), name


def test_readme_names_what_there_is():
    """The lines of README.md's Python section use public names only."""
    text = (Path(__file__).resolve().parent.parent / "README.md").read_text(encoding="utf-8")
    for block in re.findall(r"```python\n(.*?)```", text, re.DOTALL):
        for name in re.findall(r"\bwarpdem\.(\w+)", block):
            assert name in warpdem.__all__, name
        for name in re.findall(r"\bsim\.(\w+)", block):
            assert hasattr(warpdem.Simulation, name), name
        for name in re.findall(r"\bsim\.particles\.(\w+)", block):
            assert hasattr(observers.Particles, name), name
