"""A page around its sections: head with style and script, title, contents; and the file that it is written to."""

from __future__ import annotations

from collections.abc import Sequence
from importlib import resources
from pathlib import Path

from warpdem.core.atomic_file import replaced
from warpdem.errors import WarpdemError
from warpdem.reports.html import Node, el, page_text, raw

Sections = Sequence[tuple[str, Sequence[Node]]]

POLICY = (
    "default-src 'none'; img-src data:; media-src data: 'self' file:; style-src 'unsafe-inline'; script-src 'unsafe-inline'"
)
"""What the page may load: nothing from anywhere, whatever the texts of a scene say; it may be sent on."""


def document(title: str, kind: str, line: Sequence[Node | str], body: Sections) -> Node:
    """A page.

    Args:
        title: its heading.
        kind: what the page is, for the title of the window.
        line: what stands below the heading.
        body: heading and elements of each section.
    """
    style, script = (resources.files("warpdem.reports").joinpath(name).read_text("utf-8") for name in ("page.css", "page.js"))
    head = el(
        "head",
        el("meta", charset="utf-8"),
        el("title", f"{title} \u2013 {kind}"),
        el("meta", name="viewport", content="width=device-width, initial-scale=1"),
        el("meta", name="generator", content="warpdem"),
        el("meta", http_equiv="Content-Security-Policy", content=POLICY),
        raw("style", style),
    )
    header = el("header", el("h1", title), el("p", *line), el("button", "Light or dark", type="button", id="theme"))
    parts = [
        el("section", el("h2", name, id=f"part-{k}"), *nodes, aria_labelledby=f"part-{k}")
        for k, (name, nodes) in enumerate(body)
    ]
    links = [el("li", el("a", name, href=f"#part-{k}")) for k, (name, _) in enumerate(body)]
    contents = el("nav", el("ul", *links), aria_label="Contents")
    main = el("main", *parts, id="main")
    skip = el("a", "To the report", href="#main", class_="skip")
    return el("html", head, el("body", skip, header, contents, main, raw("script", script)), lang="en")


def page_file(path: Path) -> Path:
    """The file of a page.

    Raises:
        WarpdemError: its name does not end in .html.
    """
    if path.suffix.lower() not in (".html", ".htm"):
        raise WarpdemError(f"{path}: a report is an HTML page; take a name that ends in .html")
    return path


def write_page(path: Path, root: Node) -> Path:
    """Write a page, whole or not at all; returns the file."""
    text = page_text(root)
    path.parent.mkdir(parents=True, exist_ok=True)
    with replaced(path) as part:
        part.write_text(text, encoding="utf-8")
    return path
