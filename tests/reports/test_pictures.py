"""What a page embeds: three frames, a film, or what is there of them."""

import base64
import io
import json

import imageio.v2 as imageio
import pytest

import twelve_grains
from warpdem import runs
from warpdem.app import cli
from warpdem.reports import pictures


@pytest.fixture
def empty(tmp_path):
    (tmp_path / "run.json").write_text(json.dumps({"status": "done"}))
    return tmp_path


def test_the_first_the_middle_and_the_last_frame_are_drawn(tmp_path, monkeypatch):
    monkeypatch.setattr(pictures, "SIZE", (160, 120))
    output = {"interval": 1e-3, "formats": ["vtk"], "picture": False}
    twelve_grains.run(twelve_grains.scene(output=output), tmp_path)
    said = []
    found = pictures.pictures(runs.read(tmp_path), said.append)
    assert [figure.find("figcaption").text.split(",")[0] for figure in found] == ["At 0 s", "At 0.003 s", "At 0.006 s"]
    assert len(said) == 3 and "0.003 s" in said[1]
    for figure in found:
        image = figure.find("img")
        kind, _, code = image.get("src").partition(",")
        assert kind == "data:image/png;base64" and image.get("alt")
        assert imageio.imread(io.BytesIO(base64.b64decode(code))).shape[:2] == (120, 160)
    assert len({figure.find("img").get("src") for figure in found}) == 3


def test_frames_are_drawn_from_the_side_that_is_asked_for(tmp_path, monkeypatch):
    """Also by the command: pictures of one frame from two sides differ, those from the side of "auto" do not."""
    monkeypatch.setattr(pictures, "SIZE", (160, 120))
    twelve_grains.run(twelve_grains.scene(output={"interval": 1.0, "formats": ["vtk"], "picture": False}), tmp_path)
    pages = [tmp_path / f"{name}.html" for name in ("auto", "front", "left")]
    for page in pages:
        cli.app(["report", str(tmp_path), "--out", str(page), "--camera", page.stem, "--quiet"], result_action="return_value")
    texts = [page.read_text().split("data:image/png;base64,")[1:] for page in pages]
    auto, front, left = ([part.split('"')[0] for part in parts] for parts in texts)
    assert auto == front and len(left) == len(front) == 2 and not set(front) & set(left)


def test_without_frames_there_is_the_picture_that_the_run_drew(empty):
    assert pictures.pictures(runs.read(empty)) == []
    (empty / "picture.png").write_bytes(b"png")
    [figure] = pictures.pictures(runs.read(empty))
    assert figure.find("img").get("src") == "data:image/png;base64," + base64.b64encode(b"png").decode()


def test_a_film_is_embedded_and_a_large_one_linked_to(empty, monkeypatch):
    assert pictures.film(runs.read(empty)) is None
    (empty / "a.mp4").write_bytes(b"one")
    (empty / "film.mp4").write_bytes(b"other")
    figure = pictures.film(runs.read(empty))
    assert figure.find("video").get("src") == "data:video/mp4;base64," + base64.b64encode(b"other").decode()
    monkeypatch.setattr(pictures, "LARGEST_FILM", 4)
    linked = pictures.film(runs.read(empty))
    assert linked.find("a").get("href") == "film.mp4" and "too large" in "".join(linked.itertext())
