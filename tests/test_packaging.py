"""What is installed is what lies in the checkout."""

import subprocess
import sys
import tomllib
import zipfile
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parent.parent


@pytest.fixture(scope="module")
def project():
    return tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))


def folders_with_code() -> set[str]:
    """Import names of all folders of the packages that hold an __init__.py."""
    found = {p.parent.relative_to(ROOT).as_posix().replace("/", ".") for p in (ROOT / "warpdem").rglob("__init__.py")}
    found = {name for name in found if not name.startswith("warpdem.kernels")}  # an editor's link to ../kernels
    kernels = {p.parent.relative_to(ROOT).as_posix().replace("/", ".") for p in (ROOT / "kernels").rglob("__init__.py")}
    return found | {f"warpdem.{name}" for name in kernels} | {"warpdem.scenes"}


def test_package_list_is_what_lies_on_disk(project):
    """A folder missing from the list passes every other test in an editable install and is absent from the wheel."""
    assert set(project["tool"]["setuptools"]["packages"]) == folders_with_code()
    assert len(project["tool"]["setuptools"]["packages"]) == len(folders_with_code())


def test_every_folder_of_kernels_is_a_package():
    for path in (ROOT / "kernels").rglob("*.py"):
        assert (path.parent / "__init__.py").exists(), path


def test_folder_kernels_refuses_its_bare_name():
    done = subprocess.run([sys.executable, "-c", "import kernels"], cwd=ROOT, capture_output=True, text=True)
    assert done.returncode == 1
    assert "imported as warpdem.kernels" in done.stderr


def test_folder_of_the_checkout_says_that_it_hides_the_installed_package(tmp_path):
    """As Python in the checkout finds it after "pip install .": the bare folder warpdem/, which has no kernels."""
    bare = tmp_path / "warpdem"
    bare.mkdir()
    (bare / "__init__.py").write_bytes((ROOT / "warpdem" / "__init__.py").read_bytes())
    code = (
        "import sys\n"
        "sys.meta_path = [f for f in sys.meta_path if 'ditable' not in str(f)]  # which knows kernels/\n"
        f"sys.path.insert(0, {str(tmp_path)!r})\n"
        "import warpdem\n"
    )
    done = subprocess.run([sys.executable, "-c", code], cwd=tmp_path, capture_output=True, text=True)
    assert done.returncode == 1
    [said] = [line for line in done.stderr.splitlines() if line.startswith("ImportError")]
    assert said.startswith(f"ImportError: {bare} is a folder of the checkout") and "pip install -e ." in said


def test_wheel_holds_kernels_and_nothing_bare(tmp_path):
    """The wheel itself, built from a copy so that nothing is left in the checkout."""
    pytest.importorskip("setuptools", minversion="77", reason="the build backend is not installed")
    code = (
        "import os, pathlib, shutil, setuptools.build_meta as backend\n"
        f"root, work = pathlib.Path({str(ROOT)!r}), pathlib.Path({str(tmp_path)!r}) / 'copy'\n"
        "work.mkdir()\n"
        "shutil.copytree(root / 'warpdem', work / 'warpdem', ignore=shutil.ignore_patterns('__pycache__', 'kernels'))\n"
        "shutil.copytree(root / 'kernels', work / 'kernels', ignore=shutil.ignore_patterns('__pycache__'))\n"
        "shutil.copytree(root / 'scenes', work / 'scenes', ignore=shutil.ignore_patterns('__pycache__'))\n"
        "for name in ('pyproject.toml', 'README.md', 'LICENSE'): shutil.copy(root / name, work / name)\n"
        "os.chdir(work)\n"
        "backend.build_wheel(str(work.parent))\n"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr[-2000:]
    [wheel] = tmp_path.glob("warpdem-*.whl")
    names = zipfile.ZipFile(wheel).namelist()
    held = {name for name in names if name.endswith(".py")}
    own = {p.relative_to(ROOT).as_posix() for p in (ROOT / "warpdem").rglob("*.py")}
    wanted = {name for name in own if not name.startswith("warpdem/kernels/")}  # an editor's link to ../kernels
    wanted |= {f"warpdem/{p.relative_to(ROOT).as_posix()}" for p in (ROOT / "kernels").rglob("*.py")}
    assert held == wanted | {"warpdem/scenes/__init__.py"}
    gallery = [*(ROOT / "scenes").glob("*.toml"), *(ROOT / "scenes" / "meshes").glob("*.stl")]
    assert {f"warpdem/{path.relative_to(ROOT).as_posix()}" for path in gallery} <= set(names)
    assert not [name for name in names if "/paper/" in name or name.endswith(".png")]


def test_metadata_names_licence_authors_and_page(project):
    """What an index shows; the licence file is the text of the expression."""
    about = project["project"]
    assert (about["license"], about["license-files"], about["readme"]) == ("Apache-2.0", ["LICENSE"], "README.md")
    assert "Apache License" in (ROOT / "LICENSE").read_text() and about["authors"] == [{"name": "warpdem developers"}]
    assert not [c for c in about["classifiers"] if c.startswith("License ::")], "an index refuses both"
    assert f"version: {about['version']}" in (ROOT / "CITATION.cff").read_text()
    assert f"Version {about['version']}" in (ROOT / "CHANGELOG.md").read_text()


def test_top_level_holds_seven_names_and_what_hosts_and_indexes_expect():
    listed = subprocess.run(["git", "ls-files"], cwd=ROOT, capture_output=True, text=True)
    if listed.returncode:
        pytest.skip("not a checkout")
    own = {"README.md", "pyproject.toml", "kernels", "scenes", "tests", "tools", "warpdem"}
    expected = {"LICENSE", "CHANGELOG.md", "CONTRIBUTING.md", "CITATION.cff", ".github", ".ci", ".gitignore"}
    assert {name.split("/")[0] for name in listed.stdout.splitlines()} == own | expected


def test_command_is_installed(project):
    assert project["project"]["scripts"] == {"warpdem": "warpdem.__main__:main"}
