"""The page of a sweep: all rows, links to their folders, and charts of results against what was varied by numbers."""

import json
import math

import pytest

from browser import check_access
from page_check import check_html
from warpdem.reports.sweep_page import write_sweep_page

ROWS = [{"frame.rate": f'"{rate} rpm"', "title": title} for rate, title in ((10, "a"), (30, "b"), (20, "<c>"))]
RESULTS = [{"kinetic:last": 1.0}, {"kinetic:last": 3.0}, {"kinetic:last": math.nan}]
STATES = [("done", ""), ("done", ""), ("wrong", "hot & <wet>")]


@pytest.fixture
def page(tmp_path):
    return write_sweep_page(tmp_path, "Sweep of s.toml", ROWS, RESULTS, STATES)


def test_rows_and_charts(page):
    text = page.read_text(encoding="utf-8")
    assert "2 of 3 rows are done." in text and text.count("<tr>") >= 4
    assert 'href="0001/"' in text and 'href="0003/"' not in text and "hot &amp; &lt;wet&gt;" in text
    assert text.count('class="chart"') == 1  # titles are no numbers
    data = json.loads(text.split('<script type="application/json">')[1].split("</script>")[0])
    assert data["x"] == [10, 20, 30] and data["curves"] == [["kinetic:last", [1, None, 3]]]
    assert 'class="dots c0"' in text


def test_it_is_html_without_a_fault(page):
    check_html(page)


@pytest.mark.parametrize("dark", [False, True], ids=["light", "dark"])
def test_in_a_browser_nothing_is_out_of_reach_of_people_who_see_or_point_otherwise(page, dark):
    check_access(page, dark)
