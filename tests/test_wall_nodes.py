"""Values of a wall shaded between its triangles: forces are kept, sharp edges stay sharp, and pixels between show it."""

from dataclasses import replace

import numpy as np
import pytest
import trimesh

from pictures import BOX, FRONT, PANE, draw, snapshot, write
from warpdem.core.snapshot import WallLoad, WallMesh
from warpdem.drawing.wall_nodes import at_nodes, nodes_of


def linear_integral(values, nodes, triangles):
    a, b, c = (nodes[triangles[:, k]] for k in range(3))
    return (0.5 * np.linalg.norm(np.cross(b - a, c - a), axis=1) * values[triangles].mean(axis=1)).sum()


@pytest.mark.parametrize("welded", [True, False], ids=["shared corners", "corners of each triangle"])
def test_a_pressure_keeps_its_force(welded):
    ball = trimesh.creation.icosphere(subdivisions=2)
    vertices, triangles = np.array(ball.vertices), np.array(ball.faces)
    if not welded:
        vertices, triangles = vertices[triangles].reshape(-1, 3), np.arange(3 * len(triangles)).reshape(-1, 3)
    pressure = np.random.default_rng(1).uniform(0.0, 5.0, len(triangles))
    nodes, corners = nodes_of(vertices, triangles)
    assert len(nodes) == 162  # one for each corner of a smooth surface
    np.testing.assert_allclose(nodes[corners], vertices[triangles], rtol=0, atol=1e-6)
    smooth = at_nodes(pressure, nodes, corners)
    np.testing.assert_allclose(linear_integral(smooth, nodes, corners), (ball.area_faces * pressure).sum(), rtol=1e-5)
    assert np.ptp(smooth) < 0.8 * np.ptp(pressure)


def test_values_do_not_go_across_a_sharp_edge():
    pressure = np.where(np.arange(12) < 2, 1000.0, 0.0)
    nodes, corners = nodes_of(BOX.vertices, BOX.triangles)
    assert len(nodes) == 24
    np.testing.assert_array_equal(at_nodes(pressure, nodes, corners)[corners], pressure[:, None] * np.ones(3))


def strip(tmp_path, name="pressure"):
    """A flat wall of two squares in the picture's plane, with a load on the right one."""
    x, z = np.array([-0.3, 0.0, 0.3]), np.array([-0.2, 0.2])
    vertices = np.array([[a, 0.0, b] for b in z for a in x])
    wall = WallMesh("strip", vertices, np.array([[0, 1, 4], [0, 4, 3], [1, 2, 5], [1, 5, 4]], dtype=np.int32))
    load = WallLoad(np.zeros(3), np.zeros(3), np.zeros(3), 0.0, np.zeros((4, 3)), np.array([0.0, 0.0, 100.0, 100.0]))
    force = np.array([[0.0, 0, 0], [0, 0, 0], [0, 100.0, 0], [0, 100.0, 0]])
    state = replace(snapshot(np.zeros((0, 3)), 0.1), loads={"strip": replace(load, triangle_force=force)})
    state = replace(state, walls={"strip": state.walls["box"]})
    return write(tmp_path, state, walls=[wall])


def reds(image):
    """How red a line of pixels from left to right is: 0 for white, 1 for the darkest."""
    middle = image[190:210, PANE // 2 - 100 : PANE // 2 + 100, 1].astype(float).mean(axis=0)
    return (255.0 - middle) / 255.0


def test_neighbouring_triangles_shade_into_each_other(tmp_path):
    look = {**FRONT, "wall_colour": "pressure", "opacity": 1.0, "wall_range": (0.0, 100.0)}
    folder = strip(tmp_path)
    smooth, sharp = (reds(draw(folder, tmp_path / "a.png", **look, wall_smooth=on)) for on in (True, False))
    assert np.abs(np.diff(sharp[20:-20])).max() > 0.3  # a step in the middle
    assert np.abs(np.diff(smooth[20:-20])).max() < 0.05
    assert smooth[-5] - smooth[5] > 0.4
    np.testing.assert_array_equal(smooth, reds(draw(folder, tmp_path / "b.png", **look)))  # the default


def test_forces_of_triangles_are_not_averaged(tmp_path):
    look = {**FRONT, "wall_colour": "force", "opacity": 1.0, "wall_range": (0.0, 100.0)}
    assert np.abs(np.diff(reds(draw(strip(tmp_path), tmp_path / "a.png", **look)))[20:-20]).max() > 0.3
