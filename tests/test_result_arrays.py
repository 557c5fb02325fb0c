"""The arrays of the results: names that files and users count on, and fields that they are read from."""

from dataclasses import fields

import pytest

from warpdem.core.snapshot import ContactNetwork, Snapshot, WallLoad
from warpdem.output.result_arrays import (
    CONTACT_ARRAYS,
    GRAIN_ARRAYS,
    ORIENTATION,
    TRIANGLE_ARRAYS,
    WALL_ARRAYS,
)

TABLES = [
    ("id type group radius mass v omega f orientation", (*GRAIN_ARRAYS, ORIENTATION), Snapshot),
    ("i j wall force normal_force friction_force overlap sliding damping_force", CONTACT_ARRAYS, ContactNetwork),
    ("force pressure", TRIANGLE_ARRAYS, WallLoad),
    ("force torque torque_about power", WALL_ARRAYS, WallLoad),
]


@pytest.mark.parametrize(("names", "entries", "owner"), TABLES)
def test_each_array_is_declared_once_and_read_from_a_field_of_its_owner(names, entries, owner):
    assert [entry.name for entry in entries] == names.split()
    assert {entry.field for entry in entries} <= {field.name for field in fields(owner)}


def test_units_are_si():
    units = {entry.unit for _, entries, _ in TABLES for entry in entries}
    assert units == {"", "m", "kg", "m/s", "rad/s", "N", "Pa", "N m", "W"}
