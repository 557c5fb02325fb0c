"""Elements of an HTML page: text is escaped by construction, since the page is a tree that the standard library writes."""

from __future__ import annotations

import json
import math
import unicodedata
from collections.abc import Iterable, Sequence
from typing import Any
from xml.etree import ElementTree

Node = ElementTree.Element
SUPERSCRIPT = str.maketrans("-0123456789", "\u207b\u2070\xb9\xb2\xb3\u2074\u2075\u2076\u2077\u2078\u2079")


def el(tag: str, *children: Node | str | int | float | None, **attributes: str | int | float | None) -> Node:
    """An element.

    Args:
        tag: its name.
        children: what it holds, in order; None is left out.
        attributes: ``class_`` is written class, ``aria_label`` aria-label; None is left out.
    """
    named = {name.rstrip("_").replace("_", "-"): _clean(str(value)) for name, value in attributes.items() if value is not None}
    node = ElementTree.Element(tag, named)
    for child in children:
        add(node, child)
    return node


def add(node: Node, child: Node | str | int | float | None) -> None:
    """Append an element or a text."""
    if child is None:
        return
    if isinstance(child, ElementTree.Element):
        node.append(child)
    elif len(node):
        node[-1].tail = (node[-1].tail or "") + _clean(str(child))
    else:
        node.text = (node.text or "") + _clean(str(child))


def raw(tag: str, text: str, **attributes: str) -> Node:
    """A script or a style, whose text is written as it is."""
    if "</" + tag in text.lower():
        raise ValueError(f"the text would end its <{tag}>")
    node = el(tag, **attributes)
    node.text = text
    return node


def data(value: Any, **attributes: str) -> Node:
    """A script element that holds ``value`` as JSON for the page's own script."""
    text = json.dumps(value, allow_nan=False, separators=(",", ":")).replace("<", "\\u003c")
    return raw("script", text, type="application/json", **attributes)


def table(caption: str, head: Sequence[str], rows: Iterable[Sequence[Node | str | float | None]], class_: str = "") -> Node:
    """A table whose first column names its rows; numbers are set to the right."""
    body = el("tbody")
    for row in rows:
        line = el("tr")
        for k, cell in enumerate(row):
            shown = number(cell) if isinstance(cell, int | float) and not isinstance(cell, bool) else cell
            numeric = shown is not cell or shown is None
            content = "\u2013" if shown is None else shown
            line.append(el("th", content, scope="row") if k == 0 else el("td", content, class_="n" if numeric else None))
        body.append(line)
    heads = el("tr", *(el("th", name, scope="col") for name in head))
    made = el("table", el("caption", caption), el("thead", heads), body, class_=class_ or None)
    return el("div", made, class_="scroll", tabindex=0, role="region", aria_label=caption)


def number(value: float, digits: int = 4) -> str:
    """A number with so many digits, as people write it; powers of ten below 1e-4 and from 1e7."""
    if not math.isfinite(value):
        return "\u2013"
    text = f"{value:.{digits}g}"
    if isinstance(value, int) or ("e" in text and 1.0 <= abs(value) < 1e7):
        text = f"{float(text):.0f}" if isinstance(value, float) else str(value)
    mantissa, e, exponent = text.partition("e")
    if e:
        power = str(int(exponent)).translate(SUPERSCRIPT)
        text = f"{mantissa}·10{power}"
    return text.replace("-", "\u2212")


def page_text(root: Node) -> str:
    """The page as a file holds it."""
    return "<!DOCTYPE html>\n" + ElementTree.tostring(root, encoding="unicode", method="html") + "\n"


def _clean(text: str) -> str:
    """Text without what no page may hold: control characters and half pairs."""
    return "".join(c if c in "\n\t" or unicodedata.category(c) not in ("Cc", "Cs") else "\ufffd" for c in text)
