"""Whether a place is in a region: the kernel against the regions of the host, each shape, at rest and carried."""

import numpy as np
import pytest
import trimesh
import warp as wp
from warpdem.kernels import MODULE_OPTIONS
from warpdem.kernels.step import region
from warpdem.kernels.step.schedule import Placement

from warpdem import Scene
from warpdem.mesh.solid import shape_of
from warpdem.model.domain import Domain
from warpdem.model.exits import Exits
from warpdem.model.schedule import Schedule

FEW = 4000
OUTLETS = {
    "box": {"box": {"min": [-0.5, -0.6, -0.2], "max": [0.1, 0.4, 0.8]}},
    "cylinder": {"cylinder": {"point": [0.1, -0.4, 0.0], "axis": [1, 2, 0.5], "radius": 0.5, "length": 0.9}},
    "tube": {"cylinder": {"point": [0.2, 0.1, 0.0], "axis": [0, 1, 1], "radius": 0.4}},
    "sphere": {"sphere": {"centre": [0.3, 0.3, -0.2], "radius": 0.6}},
    "plane": {"plane": {"point": [0.0, 0.2, 0.0], "normal": [1, 1, -1]}},
    "disk": {"plane": {"point": [0.0, 0.2, 0.0], "normal": [1, -1, 0], "radius": 0.5}},
    "mesh": {"mesh": {"file": "ring.stl", "translate": [0.1, 0.0, 0.0]}},
    "ball": {"mesh": {"file": "ball.stl", "translate": [0.0, 0.2, 0.1]}},
}
TURN = {"axis": [1, 1, 0], "rate": 2.0}


def one_scene(folder, outlets):
    ring = trimesh.creation.annulus(r_min=0.3, r_max=0.7, height=0.6)
    ring.export(folder / "ring.stl")
    trimesh.creation.icosphere(subdivisions=2, radius=0.6).export(folder / "ball.stl")
    return Scene.model_validate(
        {
            "base": folder,
            "materials": {"g": {"density": 2500.0, "young_modulus": 1e7, "poisson_ratio": 0.3}},
            "pairs": [{"materials": ["g", "g"], "restitution": 0.7}],
            "grains": [{"material": "g", "positions": [[0, 0, 0]], "radius": 1e-3}],
            "walls": [{"name": "arm", "material": "g", "sphere": {"centre": [5, 0, 0], "radius": 0.1, "inside": False},
                       "motion": {"axis": [0, 0, 1], "origin": [0.2, 0, 0], "rate": -3.0}}],
            "frame": TURN,
            "outlets": outlets,
            "time": {"end": 1.0, "step": 1e-3},
        }
    )  # fmt: skip


@pytest.mark.parametrize("place", [{}, {"fixed_to": "laboratory"}, {"follows": "arm"}], ids=["frame", "laboratory", "wall"])
def test_the_kernel_finds_what_the_host_finds(device, tmp_path, place):
    scene = one_scene(tmp_path, [{"name": name, **shape, **place} for name, shape in OUTLETS.items()])
    domain, schedule = Domain(scene), Schedule(scene)
    schedule.dt = 1e-3
    shapes = [shape_of(scene, shape, key) for shape, key in zip(domain.shapes, domain.keys, strict=True)]
    exits = Exits(shapes, domain.places, domain.keys, schedule)
    regions, step = exits.on_device(wp.get_device(device)), 400
    region_of = region.build(count=1, kinds=domain.kinds, placed=domain.placed)

    @wp.kernel(enable_backward=False, module="unique", module_options=MODULE_OPTIONS)
    def find(
        place: wp.array(dtype=wp.vec3d), regions: region.Regions, placements: wp.array2d(dtype=Placement),
        number_out: wp.array(dtype=wp.int32),
    ):  # fmt: skip
        i = wp.tid()
        number_out[i] = region_of(place[i], regions, placements, 1)

    points = np.random.default_rng(1).uniform(-1.0, 1.0, (FEW, 3))
    placements = wp.array(schedule.placements(step, 0), dtype=Placement, device=device)  # the second row is of this step
    rows = regions.region.numpy()
    for number, (name, shape) in enumerate(zip(OUTLETS, shapes, strict=True)):
        regions.region = wp.array(rows[number : number + 1], dtype=region.Region, device=device)
        found = wp.zeros(FEW, dtype=wp.int32, device=device)
        wp.launch(find, FEW, [wp.array(points, dtype=wp.vec3d, device=device), regions, placements, found], device=device)
        axes, origin = np.eye(3), np.zeros(3)
        if place:
            axes, origin = schedule.place(schedule.carrier(domain.places[number]), step * schedule.dt)
            assert not np.allclose(axes, np.eye(3), atol=0.1)
        inside = shape.holds((points - origin) @ axes)
        assert 0.02 < inside.mean() < 0.8, name
        np.testing.assert_array_equal(found.numpy() == 0, inside, err_msg=name)


def test_faces_of_a_box_and_places_that_are_none(device):
    """A lower face is inside and an upper one is not; the first of several is named; no number is in no region."""
    rows = np.zeros((3, region.REGION_AT.width))
    for row, low in zip(rows, (0.0, 0.5, -1.0), strict=True):
        row[1], row[2:5], row[5:8] = -1, low, low + 1.0
    regions = region.Regions()
    regions.region = wp.array(rows, dtype=region.Region, device=device)
    region_of = region.build(count=3, kinds=(region.BOX,), placed=False)

    @wp.kernel(enable_backward=False, module="unique", module_options=MODULE_OPTIONS)
    def find(
        place: wp.array(dtype=wp.vec3d), regions: region.Regions, none: wp.array2d(dtype=Placement),
        number_out: wp.array(dtype=wp.int32),
    ):  # fmt: skip
        i = wp.tid()
        number_out[i] = region_of(place[i], regions, none, 0)

    points = np.array([[0, 0, 0], [0.99, 0, 0], [1, 0.9, 0.9], [0.5, 0.5, 0.5], [-0.1, -0.5, -1], [1.5, 1, 1], [np.nan, 0, 0]])
    found = wp.zeros(len(points), dtype=wp.int32, device=device)
    none = wp.zeros((0, 0), dtype=Placement, device=device)
    wp.launch(find, len(points), [wp.array(points, dtype=wp.vec3d, device=device), regions, none, found], device=device)
    assert found.numpy().tolist() == [0, 0, 1, 0, 2, -1, -1]
