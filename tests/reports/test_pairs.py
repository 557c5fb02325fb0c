"""Coefficients of two materials: those that the laws read, with units; all numbers of a record that does not tell."""

from warpdem.reports.pairs import coefficients, headed

PAIR = {"materials": ["a", "b"], "restitution": 0.5, "cohesion_energy_density": 3.0, "tail_length": 0.0, "stiffness": None}


def test_what_no_law_reads_is_left_out():
    read = {"restitution": "-", "cohesion_energy_density": "J/m3", "stiffness": "N/m"}
    assert coefficients(PAIR, read) == [("restitution", "", 0.5), ("cohesion energy density", "J/m³", 3.0)]
    assert headed(PAIR, read) == {"materials": ["a", "b"], "restitution [-]": 0.5, "cohesion energy density [J/m³]": 3.0}


def test_of_an_older_version_all_numbers_are_there():
    assert list(headed(PAIR, None)) == ["materials", "restitution", "cohesion energy density", "tail length"]
