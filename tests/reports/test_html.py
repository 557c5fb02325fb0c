"""Elements of a page: what a text holds stays text, numbers as people write them, tables that say what they are."""

import pytest

from warpdem.reports.html import data, el, number, page_text, raw, table


def text(node):
    return page_text(node).removeprefix("<!DOCTYPE html>\n").rstrip("\n")


def test_texts_and_attributes_are_escaped():
    assert text(el("p", "<script>&", class_='"<')) == '<p class="&quot;<">&lt;script&gt;&amp;</p>'
    assert text(el("p", "a", el("b", "c"), "d", None, 5)) == "<p>a<b>c</b>d5</p>"
    assert text(el("img", alt="x", aria_label="y", title=None)) == '<img alt="x" aria-label="y">'
    assert text(el("p", "a\x00\x1b\ud800b")) == "<p>a\ufffd\ufffd\ufffdb</p>"


def test_data_cannot_end_its_script():
    assert "</script><b>" not in text(data(["</script><b>"]))
    with pytest.raises(ValueError, match="would end its <style>"):
        raw("style", "a { } </STYLE>")
    with pytest.raises(ValueError, match="not JSON compliant"):
        data([float("nan")])


@pytest.mark.parametrize(
    ("value", "said"),
    [(0.0, "0"), (1234567, "1234567"), (12345.6, "12350"), (-2.5, "\u22122.5"),
     (3.2e-6, "3.2\u00b710\u207b\u2076"), (1e21, "1\u00b710\u00b2\u00b9"),
     (float("inf"), "\u2013"), (1 / 3, "0.3333")],
)  # fmt: skip
def test_numbers(value, said):
    assert number(value) == said


def test_a_table_names_its_rows_and_columns():
    made = text(table("What", ["a", "b"], [["x", 1.5], ["y", None], ["z", "word"]]))
    assert "<caption>What</caption>" in made and made.count('scope="col"') == 2 and made.count('scope="row"') == 3
    assert '<td class="n">1.5</td>' in made and '<td class="n">\u2013</td>' in made and "<td>word</td>" in made
