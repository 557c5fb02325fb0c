"""The text on methods: numbers are those of the record, what is missing is left out, the citation is that of the file."""

import re
from pathlib import Path

from warpdem.reports import methods

ROOT = Path(__file__).resolve().parents[2]
RECORD = {
    "versions": {"warpdem": "9.8.7", "warp": "1.19"},
    "grains": 12,
    "diameters": {"least": 1e-3, "mean": 1.5e-3, "greatest": 2e-3, "mass": 0.25},
    "models": {"normal": {"name": "hertz", "doc": "x"}, "integrator": {"name": "exact_drift", "doc": "y"}},
    "turning": {"axes": "frame", "angular_velocity": 3.25, "rossby": 0.5, "froude": None},
    "time": 1.5,
    "steps": 600,
    "time_step": {"used": 2.5e-6},
    "limits": [{"key": "rayleigh", "share": 0.21}],
    "extremes": {"steps_per_contact": 31.0, "pair_overlap_share": 0.011, "wall_overlap_share": 0.002},
    "state_hash": "abc",
    "pair_keys": {"restitution": "-", "rolling_friction": "-", "stiffness": "N/m", "surface_energy": "J/m2"},
    "scene_data": {
        "gravity": [0, 0, -9.81],
        "materials": {"glass": {"density": 2653.0, "young_modulus": 5e7, "poisson_ratio": 0.3}},
        "pairs": [{"materials": ["glass", "steel"], "restitution": 0.3, "rolling_friction": 0.01, "stiffness": None,
                   "surface_energy": 0.2, "tail_length": 0.0}],
        "engine": {"precision": "mixed"},
    },
}


def test_all_numbers_are_in_the_text():
    text = "\n".join(methods.sentences(RECORD))
    for what in (
        "warpdem 9.8.7", "Warp 1.19", "motion in double precision", "12 spherical grains", "1 to 2 mm (mean 1.5 mm)", "0.25 kg",
        "glass: density 2653 kg", "50 MPa", "ratio 0.3", "normal \u201chertz\u201d",
        "glass and steel: restitution 0.3, rolling friction 0.01, surface energy 0.2 J/m².",
        "(0, 0, \u22129.81)", "3.25 rad/s", "Rossby number 0.5.",
        "600 time steps of 2.5\u00b710\u207b\u2076 s, 0.21 of the Rayleigh time",
        "to 1.5 s by the integrator \u201cexact_drift\u201d", "31 time steps", "1.1 % of a radius", "final state is abc",
    ):  # fmt: skip
        assert what in text, what
    assert "Froude" not in text and "None" not in text and "stiffness" not in text and "tail length" not in text


def test_a_record_of_which_little_is_known_gives_what_there_is():
    assert methods.sentences({}) == [
        "The simulation was made by the discrete element method with warpdem of unknown version "
        "(Delacroix et al. 2020; NVIDIA Warp ?)."
    ]
    assert len(methods.sentences({"scene_data": "left out: explicit arrays; see scene_hash"})) == 1


def test_the_citation_is_that_of_the_file():
    """Against CITATION.cff."""
    text = (ROOT / "CITATION.cff").read_text(encoding="utf-8")
    bibtex = methods.citation({"versions": {"warpdem": "0.1.0"}}).replace("{\\c{c}}", "\u00e7")
    keys = "family-names|given-names|doi|journal|volume|start|end|license"
    for value in re.findall(rf"\b(?:{keys}): \"?([^\"\n]+)\"?", text):
        assert value in bibtex, value
    assert "{Simulation of granular flow in a rotating frame of reference using the discrete element method}" in bibtex
    assert bibtex.count("{") == bibtex.count("}")


def test_clumps_are_no_grains_of_their_own():
    of = {"count": 20, "members": 2, "equivalent_diameter": {"least": 2.5e-3, "mean": 2.5e-3, "greatest": 2.5e-3}}
    text = "\n".join(methods.sentences(RECORD | {"grains": 40, "clumps": {"pair": of}}))
    assert "20 rigid clumps \u201cpair\u201d of 2 spheres each" in text
    assert "same mass and material has a diameter of 2.5 mm" in text
    assert "The 40 members of clumps have diameters of 1 to 2 mm" in text and "40 spherical grains" not in text
    text = "\n".join(methods.sentences(RECORD | {"grains": 47, "clumps": {"pair": of}}))
    assert "The 7 spherical grains and the 40 members of clumps have diameters" in text
    text = "\n".join(methods.sentences(RECORD | {"clumps": {"pair": of | {"count": 1}}}))
    assert "there was 1 rigid clump \u201cpair\u201d" in text


def test_streams_and_ways_out_are_named_with_their_numbers():
    came = [{"name": "Feed", "grains": 30, "mass": 0.3}, {"grains": 4, "mass": 0.04}]
    text = "\n".join(methods.sentences(RECORD | {"came": came, "left": {"hole": {"grains": 5, "mass": 0.05}}}))
    assert "30 grains, 0.3 kg, were inserted by stream \u201cFeed\u201d." in text and "inserted by stream 1." in text
    assert "5 grains, 0.05 kg, left through \u201chole\u201d." in text
