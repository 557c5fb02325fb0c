"""The formats of the frames: the scene allows those that there are, and each has a writer of its own."""

from typing import get_args

import pytest

from warpdem import Scene
from warpdem.output.formats import FORMATS, writer_of
from warpdem.scene.settings import Output


def test_a_scene_may_ask_for_every_format_and_no_other():
    (allowed,) = get_args(Output.model_fields["formats"].annotation)
    assert set(get_args(allowed)) == set(FORMATS)


def test_each_format_has_a_writer_of_its_own_and_an_unknown_one_has_none(make_scene, tmp_path):
    scene: Scene = make_scene([[0.0, 0.0, 0.0]], step=1e-4)
    writers = [writer_of(name, tmp_path / name, [], scene) for name in FORMATS]
    assert len({type(writer) for writer in writers}) == len(FORMATS)
    for writer in writers:
        writer.close()
    with pytest.raises(KeyError):
        writer_of("ply", tmp_path / "ply", [], scene)
