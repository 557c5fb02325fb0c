"""The report as a whole: a page that parses, loads nothing, answers in a browser, and tells of runs of every kind."""

import json
import re

import pytest

import twelve_grains
from browser import check_access, evaluated
from page_check import check_html
from warpdem import WarpdemError, report
from warpdem.app import cli
from warpdem.core.run_lock import locked
from warpdem.reports import pictures

HOSTILE = "<script>document.title='hit'</script> \"a\" & 'b' \u00e9"
LARGEST = 5_000_000
"""Bytes of a page without a film [B]."""


@pytest.fixture(scope="module")
def page(tmp_path_factory):
    """The report of a run with pictures, and a title that tries to be code."""
    folder = tmp_path_factory.mktemp("report") / "out"
    output = {"interval": 2e-3, "history_interval": 1e-4, "formats": ["vtk"], "picture": False}
    twelve_grains.run(twelve_grains.scene(title=HOSTILE, output=output, measures={"energy": True}), folder)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(pictures, "SIZE", (320, 240))
        return report(folder)


def test_the_page_is_html_without_a_fault(page):
    check_html(page)


def test_the_page_is_small_and_loads_nothing(page):
    text = page.read_text(encoding="utf-8")
    assert len(text.encode()) < LARGEST
    markup = re.sub(r"<script.*?</script>", "", text, flags=re.S)
    assert not re.findall(r"""(?:src|href|action|data)\s*=\s*["']?(?!data:|#)[^"'\s>]+""", markup)
    assert "url(" not in text and "@import" not in text and "default-src 'none'" in text


def test_ids_are_there_once_and_links_lead_to_them(page):
    text = page.read_text(encoding="utf-8")
    ids = re.findall(r'\bid="([^"]+)"', text)
    assert len(ids) == len(set(ids))
    targets = re.findall(r'href="#([^"]+)"', text) + re.findall(r'aria-labelledby="([^"]+)"', text)
    assert len(targets) > 10 and set(targets) <= set(ids)


def test_every_section_is_there(page):
    heads = re.findall(r"<h2[^>]*>([^<]+)</h2>", page.read_text(encoding="utf-8"))
    assert heads == ["Overview", "Warnings", "Pictures", "Energy", "Walls", "Grains", "Scene", "Time step", "What was run",
                     "Methods and citation", "Versions"]  # fmt: skip


def test_in_a_browser_curves_tell_their_values_and_a_title_stays_text(page):
    found = evaluated(page, """
        const figure = document.querySelector(".chart"), plot = figure.querySelector(".plot");
        const box = plot.getBoundingClientRect(), data = JSON.parse(figure.querySelector("script").textContent);
        const texts = [];
        const at = (share) => {
          const x = data.frame[0] + share * (data.frame[1] - data.frame[0]);
          plot.dispatchEvent(new PointerEvent("pointermove", {clientX: box.left + x * box.width / data.frame[2]}));
          texts.push(figure.querySelector(".readout").textContent);
        };
        at(0); at(1);
        for (const key of ["Home", "ArrowRight", "End"]) {
          plot.dispatchEvent(new KeyboardEvent("keydown", {key}));
          texts.push(figure.querySelector(".readout").textContent);
        }
        const images = [...document.images].map((image) => image.complete && image.naturalWidth);
        const grounds = [getComputedStyle(document.body).backgroundColor];
        document.getElementById("theme").click();
        grounds.push(getComputedStyle(document.body).backgroundColor);
        const row = (k) => data.x[k] + ": " + data.curves.map((c) => c[0] + " " + c[1][k]).join(", ") + " [J]";
        const [first, second] = [row(0), row(1)];
        return {texts, images, grounds, title: document.title, h1: document.querySelector("h1").textContent, first, second,
                last: data.x.length - 1, wide: document.documentElement.scrollWidth - window.innerWidth};
    """)  # fmt: skip
    assert found["title"] == f"{HOSTILE} \u2013 report of a run" and found["h1"] == HOSTILE
    assert found["texts"][0] == found["texts"][2] == found["first"] and found["texts"][3] == found["second"]
    assert found["texts"][1] == found["texts"][4] != found["texts"][0]
    assert found["images"] == [320, 320, 320]
    assert found["grounds"][0] != found["grounds"][1]
    assert found["wide"] <= 0


@pytest.mark.parametrize("dark", [False, True], ids=["light", "dark"])
def test_in_a_browser_nothing_is_out_of_reach_of_people_who_see_or_point_otherwise(page, dark):
    check_access(page, dark)


def test_a_narrow_window_scrolls_down_only(page):
    assert evaluated(page, "return document.documentElement.scrollWidth - window.innerWidth;", size=(500, 900)) <= 0


def recorded(folder, record, history="time [s],kinetic [J]\n0,1\n1,2\n"):
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "run.json").write_text(json.dumps(record))
    if history is not None:
        (folder / "history.csv").write_text(history)
    return folder


def test_a_run_that_has_only_begun_has_a_report(tmp_path):
    folder = recorded(tmp_path / "a", {"status": "running", "scene": "a.toml"}, None)
    with locked(folder):
        text = report(folder).read_text()
    assert ">ended without a record</span>" in report(folder).read_text()
    assert ">running</span>" in text and "history.csv: cannot be read" in text and 'class="status bad"' in text
    recorded(tmp_path / "b", {"status": "interrupted"}, "time [s],kinetic [J]\n")
    assert "<h2" in report(tmp_path / "b").read_text()


def test_each_phase_has_its_sections_and_the_curves_are_those_of_all(tmp_path):
    step = {"used": 1e-5, "binding": "given"}
    recorded(tmp_path / "1-fill", {"status": "done", "title": "fill", "time": 1.0, "time_step": step})
    recorded(tmp_path / "2-turn", {"status": "done", "title": "turn", "time": 1.0, "time_step": step})
    phases = [{"name": n, "folder": f, "begin": float(k), "status": "done"} for k, (n, f) in
              enumerate([("fill", "1-fill"), ("turn", "2-turn")])]  # fmt: skip
    (tmp_path / "run.json").write_text(json.dumps({"status": "done", "title": "both", "phases": phases}))
    text = report(tmp_path).read_text()
    assert "Phase 1, fill: Time step" in text and "Phase 2, turn: Time step" in text
    assert '"x":[0.0,1.0,2.0]' in text


def test_more_charts_than_a_page_holds_are_named(tmp_path, monkeypatch):
    monkeypatch.setattr("warpdem.reports.write_report.MOST", 1)
    header = "time [s],kinetic [J],centre_x [m],grains [-]\n"
    text = report(recorded(tmp_path, {"status": "done"}, header + "0,1,1,1\n1,2,2,2\n")).read_text()
    assert text.count('class="chart"') == 1
    assert "2 more charts are not drawn (Centre of mass; Grains in the domain): see history.csv" in text


def test_what_is_no_run_or_no_page_is_told(tmp_path):
    with pytest.raises(WarpdemError, match=r"holds no run\.json"):
        report(tmp_path)
    with pytest.raises(WarpdemError, match=r"a\.pdf: a report is an HTML page; take a name that ends in \.html"):
        report(recorded(tmp_path / "a", {}), tmp_path / "a.pdf")


def test_the_command_writes_it_and_so_does_run(tmp_path, capsys):
    folder = recorded(tmp_path / "a", {"status": "done"})
    cli.app(["report", str(folder), "--out", str(tmp_path / "x" / "b.html"), "--no-pictures"], result_action="return_value")
    assert (tmp_path / "x" / "b.html").exists() and "b.html" in capsys.readouterr().out.replace("\n", "")
    (tmp_path / "s.toml").write_text(
        '[materials.g]\ndensity = 2500\nyoung_modulus = "5 MPa"\npoisson_ratio = 0.3\n[contact]\ntangential = "none"\n'
        '[[pairs]]\nmaterials = ["g", "g"]\nrestitution = 0.5\n[[grains]]\nmaterial = "g"\nradius = 1e-3\n'
        "positions = [[0, 0, 0]]\n"
        "[time]\nend = 1e-4\nstep = 1e-5\nmax_speed = 0.1\n[output]\nformats = []\npicture = false\n"
    )
    arguments = ["run", str(tmp_path / "s.toml"), "--out", str(tmp_path / "run"), "--device", "cpu", "--threads", "1"]
    cli.app([*arguments, "--quiet", "--report"], result_action="return_value")
    assert "<h2" in (tmp_path / "run" / "report.html").read_text()
    assert capsys.readouterr().out == ""
