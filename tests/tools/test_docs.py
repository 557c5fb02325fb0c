"""The site of the documentation: its pages and what they link to, an entry for every public name, and strictness."""

import importlib.util
import re
from pathlib import Path

import pytest

import warpdem
from dev import docs, docs_gallery, scene_keys
from warpdem.app.demo import gallery

ROOT = Path(__file__).resolve().parents[2]
FOLDERS = (".", "kernels", "scenes", "tests", "tools", "tools/dev/results", "tools/stress/results", "warpdem")
PAGES = sorted({page for folder in FOLDERS for page in (ROOT / folder).glob("*.md")} | {*(ROOT / "warpdem").rglob("*.md")})
builds = pytest.mark.skipif(importlib.util.find_spec("zensical") is None, reason='the extra "docs" is not installed')


def slug(heading: str) -> str:
    """Anchor of a heading, as hosts make it."""
    return re.sub(r"[^\w\- ]", "", re.sub(r"`|\*", "", heading).strip().lower()).replace(" ", "-")


def test_the_page_of_scenes_has_the_keys_of_the_contact_laws_as_they_are():
    block = scene_keys.block()
    assert "* `tail_length` (dmt): Length" in block and "(dmt, edinburgh, jkr, jkr_fixed_load, required)" in block
    text = scene_keys.PAGE.read_text(encoding="utf-8")
    assert scene_keys.START + block + scene_keys.END in text, "run tools/dev/scene_keys.py"


def test_the_page_of_keys_has_every_key_of_every_table_as_it_is():
    page = scene_keys.keys_page()
    assert "\n## Servo\n\nIn `walls[].servo`: A controller" in page and "\n* `max_rate`: " in page
    assert scene_keys.KEYS_PAGE.read_text(encoding="utf-8") == page, "run tools/dev/scene_keys.py"


def test_all_pages_are_looked_at():
    assert {"README.md", "CHANGELOG.md", "CONTRIBUTING.md"} <= {page.name for page in PAGES}
    assert len(PAGES) >= 10


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.relative_to(ROOT).as_posix())
def test_lines_have_120_characters_at_most(page):
    long = [number for number, line in enumerate(page.read_text(encoding="utf-8").splitlines(), 1) if len(line) > 120]
    assert not long


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.relative_to(ROOT).as_posix())
def test_links_lead_somewhere(page):
    """Files that are there, and anchors of headings that are there."""
    for link in docs.links(page):
        assert (page.parent / link).exists(), link
    text = re.sub(r"```.*?```", "", page.read_text(encoding="utf-8"), flags=re.DOTALL)
    for target in re.findall(r"\]\(([^)\s:]*#[^)\s]+)\)", text):
        file, anchor = target.split("#")
        there = (page.parent / file if file else page).read_text(encoding="utf-8")
        assert anchor in {slug(heading) for heading in re.findall(r"^#+ (.*)$", there, re.MULTILINE)}, target


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.relative_to(ROOT).as_posix())
def test_files_that_a_page_names_are_there(page):
    """Paths in code marks that begin with a folder of the repository, from its root or from the page's folder."""
    text = re.sub(r"```.*?```", "", page.read_text(encoding="utf-8"), flags=re.DOTALL)
    for name in re.findall(r"`((?:kernels|scenes|tests|tools|warpdem)/[\w/.]+\.(?:py|toml|md|json|png|usda))`", text):
        assert (ROOT / name).exists() or (page.parent / name).exists(), name


def test_the_tour_visits_each_file_once_and_finds_there_what_it_names():
    page = (ROOT / "kernels" / "README.md").read_text(encoding="utf-8")
    section = page.split("## A tour")[1].split("\n## ")[0]
    stops = re.findall(r"^(\d+)\. `([\w/.]+)`: (.+?)\n(?=\d+\. |\n)", section, re.MULTILINE | re.DOTALL)
    assert [int(number) for number, _, _ in stops] == list(range(1, len(stops) + 1))
    files = [file for _, file, _ in stops]
    assert len(files) == len(set(files)) == len(re.findall(r"^\d+\. ", section, re.MULTILINE)) >= 30
    assert files[0].startswith("scenes/") and files[-1].startswith("warpdem/output/")
    for _, file, words in stops:
        names = [name.split(".")[-1] for name in re.findall(r"`([A-Za-z_][\w.]*)(?: = [^`]*)?`", words)]
        assert names, file
        text = (ROOT / file).read_text(encoding="utf-8")
        assert not [name for name in names if not re.search(rf"\b{name}\b", text)], file


def test_every_public_name_has_an_entry():
    names = [name for names in docs.public_names().values() for name in names]
    assert len(names) == len(set(names))
    ends = {name.split(".")[-1] for name in names}
    others = {"run_scene", "Particles", "Grains", "hertz", "Material", "Wall"}
    assert {name for name in warpdem.__all__ if name != "__version__"} | others <= ends


def test_a_link_that_leads_nowhere_is_named(tmp_path, monkeypatch):
    (tmp_path / "README.md").write_text("[a](there.md) [b](missing.md) `[c](code.md)` [d](https://x.y/z.md)\n")
    (tmp_path / "there.md").write_text("![](picture.png)\n")
    (tmp_path / "picture.png").write_bytes(b"x")
    monkeypatch.setattr(docs, "ROOT", tmp_path)
    monkeypatch.setattr(docs, "PAGES", {"README.md": "Home"})
    with pytest.raises(FileNotFoundError, match=r"README\.md links to missing\.md"):
        docs.gather(tmp_path / "out")
    (tmp_path / "missing.md").write_text("")
    docs.gather(tmp_path / "out")
    assert sorted(p.name for p in (tmp_path / "out").iterdir()) == ["README.md", "missing.md", "picture.png", "there.md"]


def test_the_gallery_has_every_scene_with_what_its_file_and_the_readme_say(tmp_path):
    page = (tmp_path / docs_gallery.write_gallery(tmp_path)).read_text(encoding="utf-8")
    sections = dict(re.findall(r"^## (\w+)\n(.*?)(?=^## |\Z)", page, re.MULTILINE | re.DOTALL))
    scenes = gallery()
    assert list(sections) == list(scenes)
    plain = {name: re.sub(r"\\([*_<])", r"\1", text) for name, text in sections.items()}
    for name, scene in scenes.items():
        assert all(words in plain[name] for words in (scene.about, scene.shown, scene.outcome, scene.takes)), name
        assert f"    warpdem demo {name}\n" in plain[name] and "**Came out:** " in plain[name]
    assert "**Came out:** 11.92 g/s" in plain["kiln"] and "**Came out:** 1483." in plain["tumbled_test"]
    pictures = {target for target in docs.LINK.findall(page) if target.endswith(".png")}
    assert pictures == {f"scenes/{path.name}" for path in (ROOT / "scenes").glob("*.png")}
    assert all((tmp_path / picture).exists() for picture in pictures)


@builds
def test_the_site_is_built_whole(tmp_path):
    assert docs.build(tmp_path) == []
    assert "Must come out" in (tmp_path / "gallery.html").read_text() and (tmp_path / "scenes" / "drum.png").exists()
    page = (tmp_path / "reference" / "what_a_simulation_hands_out.html").read_text()
    assert "in frame axes" in page and (tmp_path / "kernels" / "API.html").exists() and (tmp_path / "index.html").exists()


@builds
def test_a_name_that_is_not_there_ends_the_build(tmp_path, monkeypatch):
    monkeypatch.setattr(docs, "PAGES", {"CHANGELOG.md": "Changelog"})
    monkeypatch.setattr(docs, "public_names", lambda: {"One": ["warpdem.simulation.Nothing"]})
    with pytest.raises(RuntimeError, match=r"warpdem\.simulation\.Nothing"):
        docs.build(tmp_path / "site")
