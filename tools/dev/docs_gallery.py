"""The page of the gallery on the site: all scenes, from their first comments and what scenes/README.md says came out."""

import re
import shutil
from pathlib import Path

from warpdem.app.demo import Demo, gallery

ROOT = Path(__file__).resolve().parents[2]
PAGE = "gallery.md"
HEAD = """# Gallery

Scenes that are installed with warpdem. `warpdem demo NAME` copies one to a folder and runs it there; what must come out is
tested. Run times are of one core. The keys of a scene: [Scenes](scenes/README.md).
"""


def results(readme: str) -> dict[str, str]:
    """What scenes/README.md says came out of a scene, by its name: the bullets that name a command or a standard test.

    Args:
        readme: Text of the page.
    """
    found: dict[str, str] = {}
    bullets = re.findall(r"^\* \*\*[^\n]*(?:\n(?!\* |\n)[^\n]*)*", readme, re.MULTILINE)
    for text in (" ".join(bullet.split()) for bullet in bullets):
        for name in re.findall(r"`warpdem demo (\w+)`", text):
            if match := re.search(r"Result[^:]*: (.*?)(?: \[Picture\].*)? Run time:", text):
                found[name] = match[1]
        for name, words in re.findall(r"`(\w+_test)`: [^`]*?result: ([^`]*?)(?= `|\. Run time|$)", text):
            found[name] = f"{words.rstrip('. ')}."
    return found


def entry(scene: Demo, result: str | None, picture: bool) -> str:
    """Section of a scene."""
    lines = [f"## {scene.name}", scene.about]
    if picture:
        lines.append(f"![{scene.name}](scenes/{scene.name}.png)")
    lines.append(f"    warpdem demo {scene.name}")
    parts = "Shown", "Must come out", "Came out", "Seen in", "Takes"
    said = zip(parts, (scene.shown, scene.outcome, result, scene.seen, scene.takes), strict=True)
    lines.append("\n".join(f"* **{part}:** {_escaped(words)}" for part, words in said if words))
    return "\n\n".join(lines)


def write_gallery(target: Path) -> str:
    """Write the page and its pictures into the folder of the site's sources; the name of the page."""
    came_out = results((ROOT / "scenes" / "README.md").read_text(encoding="utf-8"))
    (target / "scenes").mkdir(exist_ok=True)
    sections = []
    for scene in gallery().values():
        picture = ROOT / "scenes" / f"{scene.name}.png"
        if picture.exists():
            shutil.copy(picture, target / "scenes")
        sections.append(entry(scene, came_out.get(scene.name), picture.exists()))
    (target / PAGE).write_text("\n\n".join([HEAD.strip(), *sections]) + "\n", encoding="utf-8")
    return PAGE


def _escaped(words: str) -> str:
    """Text of a comment, which is no Markdown, without what Markdown takes for marks; code and links of a README stay."""
    parts = re.split(r"(`[^`]*`)", words)
    return "".join(part if part.startswith("`") else re.sub(r"([*_<])", r"\\\1", part) for part in parts)
