"""Build the site of the documentation from the READMEs and the docstrings: `python tools/dev/docs.py [--out build/site]`.

Needs the extra "docs" (`pip install -e ".[docs]"`). The pages keep their places in the repository, so their links hold on the
site as they do in a checkout; what they link to besides pages is copied beside them. The reference has one entry per public
name: those of ``warpdem``, the tables of a scene, what ``Simulation`` hands out, ``run_scene``, ``warpdem.kernels.api`` and
the modules of the models.
A broken link or anchor, a name that is not there or a public name without an entry ends with exit code 1.

Zensical, the successor of Material for MkDocs by its authors, builds the pages; mkdocstrings with griffe-pydantic builds the
reference.
"""

import argparse
import importlib
import inspect
import json
import re
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import get_args

from pydantic import BaseModel

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT / "tools"))

from dev.docs_gallery import write_gallery  # noqa: E402

OUT = ROOT / "build" / "site"
PAGES = {
    "README.md": "Overview",
    "scenes/TUTORIAL.md": "From an STL file to a report",
    "scenes/CONTACT_LAW.md": "A contact law of your own",
    "scenes/CLUSTER.md": "On a cluster",
    "scenes/README.md": "Scenes",
    "scenes/KEYS.md": "Every key of a scene",
    "scenes/COMING_FROM.md": "Coming from LIGGGHTS, LAMMPS, YADE, EDEM",
    "kernels/README.md": "Kernels",
    "kernels/API.md": "Kernels in a program of your own",
    "tests/README.md": "What is proven",
    "tools/README.md": "Benchmarks and tools",
    "CONTRIBUTING.md": "Contributing",
    "CHANGELOG.md": "Changelog",
}
LINK = re.compile(r"\]\(([^)\s]+)\)")
ROLES = ("normal", "tangential", "rolling", "twisting", "field", "observer", "integrator")
READINGS = ("measure.observers.Particles", "measure.observers.Contacts", "core.snapshot.WallLoad")
"""Classes that ``Simulation`` hands out, in ``warpdem``."""
RESULTS = ("runs.run.read", "runs.run.Run", "runs.history.History", "runs.history.NoColumn")
"""What reads the results of a run back, in ``warpdem``."""


def public_names() -> dict[str, list[str]]:
    """Title of each page of the reference, and the full names of its entries."""
    from warpdem.kernels import api

    import warpdem

    found = {name: getattr(warpdem, name) for name in warpdem.__all__ if name != "__version__"}
    classes = [thing for thing in found.values() if inspect.isclass(thing)]
    errors = [thing for thing in classes if issubclass(thing, Exception)]
    functions = [thing for thing in found.values() if not inspect.isclass(thing)]
    run = importlib.import_module("warpdem.runner").run_scene
    own = [getattr(api, name) for name in api.__all__ if name != "Record"]  # a Warp type, which has no docstring
    files = [path for role in ROLES for path in sorted((ROOT / "kernels" / role).glob("[!_]*.py"))]
    return {
        "Scene and Simulation": [*map(full_name, (c for c in classes if c not in errors))],
        "Tables of a scene": [*map(full_name, scene_tables(found["Scene"]))],
        "What a simulation hands out": [f"warpdem.{name}" for name in READINGS],
        "Results of a run": [f"warpdem.{name}" for name in RESULTS],
        "Functions": [*map(full_name, (*functions, run))],
        "Errors": [*map(full_name, errors)],
        "Kernel API": [*map(full_name, own)],
        "Models": [f"warpdem.kernels.{path.parent.name}.{path.stem}" for path in files],
    }


def scene_tables(model: type[BaseModel]) -> list[type[BaseModel]]:
    """Models that the fields of a model hold, and those of theirs, each once, in the order of the fields."""
    found: dict[type[BaseModel], None] = {}

    def visit(annotation) -> None:
        if inspect.isclass(annotation) and issubclass(annotation, BaseModel) and annotation not in found:
            found[annotation] = None
            for field in annotation.model_fields.values():
                visit(field.annotation)
        for inner in get_args(annotation):
            visit(inner)

    for field in model.model_fields.values():
        visit(field.annotation)
    return list(found)


def full_name(thing) -> str:
    """Module and name of where a class or function is defined."""
    return f"{thing.__module__}.{thing.__qualname__}"


def links(page: Path) -> list[str]:
    """Relative files that a page links to, as written, without anchors; code is passed over."""
    text = re.sub(r"```.*?```|`[^`\n]*`", "", page.read_text(encoding="utf-8"), flags=re.DOTALL)
    targets = (target.split("#")[0] for target in LINK.findall(text))
    return [target for target in targets if target and not re.match(r"[a-z]+:", target)]


def gather(target: Path) -> None:
    """Copy the pages and all that they link to.

    Raises:
        FileNotFoundError: a link leads nowhere.
    """
    waiting, done = list(PAGES), set()
    while waiting:
        name = waiting.pop()
        if name in done:
            continue
        done.add(name)
        (target / name).parent.mkdir(parents=True, exist_ok=True)
        shutil.copy(ROOT / name, target / name)
        if name.endswith(".md"):
            for link in links(ROOT / name):
                file = (ROOT / name).parent / link
                if not file.exists():
                    raise FileNotFoundError(f"{name} links to {link}, which is not there")
                waiting.append(file.resolve().relative_to(ROOT).as_posix())


def reference(target: Path) -> list[dict[str, str]]:
    """Write the pages of the reference; entries of the navigation."""
    (target / "reference").mkdir()
    nav = []
    for title, names in public_names().items():
        file = f"reference/{title.lower().replace(' ', '_')}.md"
        (target / file).write_text(f"# {title}\n\n" + "\n\n".join(f"::: {name}" for name in names) + "\n")
        nav.append({title: file})
    return nav


def sources(target: Path) -> None:
    """The package as it is installed: ``kernels`` is a folder of it."""
    package = target / "warpdem"
    package.mkdir(parents=True)
    for entry in (ROOT / "warpdem").iterdir():
        if entry.name not in ("kernels", "scenes", "__pycache__"):
            (package / entry.name).symlink_to(entry)
    (package / "kernels").symlink_to(ROOT / "kernels")


def config(nav: list[dict[str, str]], gallery: str) -> dict:
    """Settings, in the form of mkdocs, with the page of the gallery; folders are relative to that of the file."""
    first, *others = ({title: name} for name, title in PAGES.items())
    options = {
        "docstring_style": "google",
        "docstring_options": {"warn_unknown_params": False, "warn_missing_types": False},
        "show_root_heading": True,
        "show_root_full_path": False,
        "show_source": False,
        "members_order": "source",
        "merge_init_into_class": True,
        "extensions": ["griffe_pydantic", str(Path(__file__).with_name("docs_fields.py"))],  # keys of a scene, described
    }
    python = {"paths": ["src"], "options": options}
    return {
        "site_name": "warpdem",
        "docs_dir": "docs",
        "site_dir": "site",
        "use_directory_urls": False,
        "strict": True,
        "theme": {"name": "material", "font": False, "features": ["navigation.indexes", "toc.follow"]},
        "plugins": ["search", {"mkdocstrings": {"handlers": {"python": python}}}],
        "markdown_extensions": ["tables", "fenced_code", "toc", "admonition"],
        "validation": {"links": dict.fromkeys(("not_found", "anchors", "absolute_links", "unrecognized_links"), "warn")},
        "nav": [first, {"Gallery": gallery}, *others, {"Reference": nav}],
    }


def build(out: Path) -> list[str]:
    """Build the site into a folder; the public names that it lacks.

    Raises:
        FileNotFoundError: a link of a page leads nowhere.
        RuntimeError: the site cannot be built without a warning.
    """
    with tempfile.TemporaryDirectory() as folder:
        work = Path(folder)
        (work / "docs").mkdir()
        gather(work / "docs")
        nav = reference(work / "docs")
        sources(work / "src")
        (work / "mkdocs.yml").write_text(json.dumps(config(nav, write_gallery(work / "docs"))))  # JSON is YAML
        command = [sys.executable, "-m", "zensical", "build", "--strict", "-f", "mkdocs.yml"]
        done = subprocess.run(command, cwd=work, capture_output=True, text=True, check=False)
        if done.returncode:
            raise RuntimeError((done.stdout + done.stderr).strip())
        html = "".join(page.read_text(encoding="utf-8") for page in (work / "site" / "reference").glob("*.html"))
        shutil.copytree(work / "site", out, dirs_exist_ok=True)
    return [name for names in public_names().values() for name in names if f'id="{name}"' not in html]


def main() -> int:
    """Entry point."""
    parser = argparse.ArgumentParser(description=__doc__.split("`")[0])
    parser.add_argument("--out", type=Path, default=OUT, help="folder of the site")
    options = parser.parse_args()
    try:
        missing = build(options.out.resolve())
    except (FileNotFoundError, RuntimeError) as error:
        print(error, file=sys.stderr)
        return 1
    for name in missing:
        print(f"{name} has no entry in the reference", file=sys.stderr)
    if not missing:
        print(options.out / "index.html")
    return 1 if missing else 0


if __name__ == "__main__":
    sys.exit(main())
