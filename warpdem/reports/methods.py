"""The section on methods of a publication: what was simulated, with all numbers, and what to cite."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

from warpdem.reports.html import number
from warpdem.reports.pairs import coefficients

CITATION = """\
@software{warpdem,
  author  = {{warpdem developers}},
  title   = {warpdem: discrete element method for granular flow in rotating and moving equipment, on NVIDIA Warp},
  version = {VERSION},
  license = {Apache-2.0}
}

@article{delacroix2020,
  author  = {Delacroix, Bastien and Bouarab, Anya and Fradette, Louis and Bertrand, Fran{\\c{c}}ois and Blais, Bruno},
  title   = {Simulation of granular flow in a rotating frame of reference using the discrete element method},
  journal = {Powder Technology},
  volume  = {369},
  pages   = {146--161},
  year    = {2020},
  doi     = {10.1016/j.powtec.2020.05.006}
}
"""
"""BibTeX of the program and of the paper whose method it implements, as CITATION.cff has them."""


def citation(record: Mapping[str, Any]) -> str:
    """BibTeX with the version that made a run, whose run.json is ``record``."""
    return CITATION.replace("VERSION", str(record.get("versions", {}).get("warpdem", "unknown")))


def sentences(record: Mapping[str, Any]) -> list[str]:
    """Paragraphs on a run from its run.json: program, grains, contacts, motion, time step, checks."""
    scene = record.get("scene_data")
    scene = scene if isinstance(scene, Mapping) else {}
    made = [_program(record), _grains(record, scene), _flows(record), _contacts(record, scene), _motion(record, scene),
            _step(record)]  # fmt: skip
    return [" ".join(paragraph) for paragraph in map(list, made) if paragraph]


def _program(record: Mapping[str, Any]) -> Iterator[str]:
    versions = record.get("versions", {})
    precision = (record.get("scene_data") or {}).get("engine", {}).get("precision") if _has_scene(record) else None
    words = {"double": "in double precision", "mixed": "with contact forces in single and motion in double precision"}
    how = f", {words[precision]}" if precision in words else ""
    yield (
        f"The simulation was made by the discrete element method with warpdem {versions.get('warpdem', 'of unknown version')} "
        f"(Delacroix et al. 2020; NVIDIA Warp {versions.get('warp', '?')}){how}."
    )


def _grains(record: Mapping[str, Any], scene: Mapping[str, Any]) -> Iterator[str]:
    size, count = record.get("diameters"), record.get("grains")
    if size and count:
        yield from _counted(count, size, record.get("clumps") or {})
    for name, material in scene.get("materials", {}).items():
        yield (
            f"Material {name}: density {number(material['density'])} kg/m³, Young's modulus "
            f"{number(material['young_modulus'] / 1e6)} MPa, Poisson's ratio {number(material['poisson_ratio'])}."
        )


def _counted(count: int, size: Mapping[str, Any], clumps: Mapping[str, Any]) -> Iterator[str]:
    """How many grains and clumps there were, and their sizes."""
    mass = f"{number(size['mass'])} kg in all"
    if not clumps:
        yield f"At the end there were {count} spherical grains with diameters {_spread(size)}, {mass}."
        return
    for name, of in clumps.items():
        there = "was 1 rigid clump" if of["count"] == 1 else f"were {of['count']} rigid clumps"
        yield (
            f"At the end there {there} “{name}” of {of['members']} spheres each; a sphere of the same "
            f"mass and material has a diameter {_spread(of['equivalent_diameter'])}."
        )
    members = sum(of["count"] * of["members"] for of in clumps.values())
    single = f"{count - members} spherical grains and the " if count > members else ""
    yield f"The {single}{members} members of clumps have diameters {_spread(size)}, {mass}."


def _spread(size: Mapping[str, float]) -> str:
    """Diameters in words."""
    least, most = number(size["least"] * 1e3), number(size["greatest"] * 1e3)
    return f"of {least} mm" if least == most else f"of {least} to {most} mm (mean {number(size['mean'] * 1e3)} mm)"


def _flows(record: Mapping[str, Any]) -> Iterator[str]:
    """What streams inserted, and what left by outlets and borders."""
    for way in named_streams(record):
        yield f"{way['grains']} grains, {number(way['mass'])} kg, were inserted by {way['name']}."
    for name, way in record.get("left", {}).items():
        yield f"{way['grains']} grains, {number(way['mass'])} kg, left through “{name}”."


def named_streams(record: Mapping[str, Any]) -> list[dict[str, Any]]:
    """What each stream inserted, with what it is called: its name or, without one, its number."""
    return [
        {**way, "name": f"stream “{way['name']}”" if way.get("name") else f"stream {k}"}
        for k, way in enumerate(record.get("came", ()))
    ]


def _contacts(record: Mapping[str, Any], scene: Mapping[str, Any]) -> Iterator[str]:
    models = record.get("models", {})
    roles = ("normal", "tangential", "rolling", "twisting", "liquid")
    named = [f"{role} “{model['name']}”" for role, model in models.items() if role in roles]
    if named:
        yield f"Contact laws: {', '.join(named)}; their equations and sources are below."
    for pair in scene.get("pairs", ()):
        found = coefficients(pair, record.get("pair_keys"))
        numbers = [f"{name} {number(value)}{unit and f' {unit}'}" for name, unit, value in found]
        yield f"Between {' and '.join(pair['materials'])}: {', '.join(numbers)}."


def _motion(record: Mapping[str, Any], scene: Mapping[str, Any]) -> Iterator[str]:
    if gravity := scene.get("gravity"):
        yield f"Gravity ({', '.join(number(value) for value in gravity)}) m/s²."
    if turning := record.get("turning"):
        ro, fr = turning.get("rossby"), turning.get("froude")
        numbers = [f"{name} number {number(value)}" for name, value in (("Rossby", ro), ("Froude", fr)) if value is not None]
        yield (
            f"Axes that turn: {turning['axes']}, at {number(turning['angular_velocity'])} rad/s (rms)"
            f"{'; ' if numbers else ''}{', '.join(numbers)}."
        )


def _step(record: Mapping[str, Any]) -> Iterator[str]:
    step, met = record.get("time_step"), record.get("extremes", {})
    if not step:
        return
    limits = {row["key"]: row for row in record.get("limits", ())}
    share = limits.get("rayleigh", {}).get("share")
    rayleigh = f", {number(share, 3)} of the Rayleigh time" if share is not None else ""
    integrator = record.get("models", {}).get("integrator", {}).get("name")
    by = f" by the integrator “{integrator}”" if integrator else ""
    yield f"{record.get('steps')} time steps of {number(step['used'])} s{rayleigh}, to {number(record.get('time', 0.0))} s{by}."
    if met.get("steps_per_contact"):
        yield f"A contact at the largest approach speed met took {number(met['steps_per_contact'], 3)} time steps."
    overlaps = [met[key] for key in ("pair_overlap_share", "wall_overlap_share") if met.get(key) is not None]
    if overlaps:
        yield f"The largest overlap met was {number(100 * max(overlaps), 3)} % of a radius."
    if record.get("state_hash"):
        yield f"The hash of the final state is {record['state_hash']}: an equal run has the same."


def _has_scene(record: Mapping[str, Any]) -> bool:
    return isinstance(record.get("scene_data"), Mapping)
