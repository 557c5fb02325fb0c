"""Pages in a browser without a screen: what a page's own script and one more make of it. Skips where there is no Chromium."""

import json
import re
import shutil
import subprocess
from html import unescape
from pathlib import Path
from typing import Any

import pytest

from page_check import library

NAMES = ("chromium", "chromium-browser", "google-chrome", "google-chrome-stable")


def evaluated(page: Path, script: str, libraries: tuple[str, ...] = (), size: tuple[int, int] = (1200, 900)) -> Any:
    """What an asynchronous function with the body ``script`` returns at the end of the page, as JSON carries it.

    Args:
        page: The page.
        script: Body of the function.
        libraries: Texts of scripts that run before it.
        size: Width and height of the window [px].
    """
    browser = next((path for name in NAMES if (path := shutil.which(name))), None)
    if browser is None:
        pytest.skip("no Chromium on this machine: pages are not opened")
    ending = (
        "(async () => { let out; try { out = {value: await (async () => {" + script + "})()}; } "
        "catch (error) { out = {error: String(error && error.stack || error)}; } "
        "const node = document.createElement('pre'); node.id = 'result-of-the-test'; "
        "node.textContent = JSON.stringify(out); document.body.append(node); })();"
    )
    scripts = "".join(f"<script>{text}</script>" for text in (*libraries, ending))
    text = page.read_text(encoding="utf-8")
    assert text.count("</body>") == 1
    copy = page.with_name(f"{page.stem}-with-a-test.html")
    copy.write_text(text.replace("</body>", scripts + "</body>"), encoding="utf-8")
    profile = page.with_name("browser-profile")
    options = ["--headless=new", "--no-sandbox", "--disable-gpu", f"--user-data-dir={profile}", "--no-first-run",
               f"--window-size={size[0]},{size[1]}", "--virtual-time-budget=20000", "--dump-dom"]  # fmt: skip
    done = subprocess.run([browser, *options, copy.resolve().as_uri()], capture_output=True, text=True, timeout=600)
    found = re.search(r'<pre id="result-of-the-test">(.*?)</pre>', done.stdout, re.DOTALL)
    assert found, f"the page's script did not end: {done.stderr[-2000:]}"
    result = json.loads(unescape(found[1]))
    assert "error" not in result, result["error"]
    return result.get("value")


def check_access(page: Path, dark: bool) -> None:
    """Raise what is out of reach of people who see or point otherwise, by the rules of axe-core, with all details open."""
    axe = (Path(library("axe_core_python").__path__[0]) / "axe.min.js").read_text(encoding="utf-8")
    found = evaluated(page, f"""
        document.documentElement.dataset.theme = "{"dark" if dark else "light"}";
        for (const details of document.querySelectorAll("details")) details.open = true;
        const result = await axe.run();
        const wrong = result.violations.map((v) => [v.id, v.nodes.map((n) => n.html.slice(0, 200))]);
        return {{passes: result.passes.length, wrong}};
    """, (axe,))  # fmt: skip
    assert found["wrong"] == []
    assert found["passes"] > 20
