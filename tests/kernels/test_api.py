"""The kernels over arrays of one's own: the program of kernels/API.md as it stands there, against the engine; shared memory."""

import importlib.util
import re
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
import warp as wp
from warpdem.kernels import api
from warpdem.kernels.normal import hertz
from warpdem.kernels.rolling import constant, spring
from warpdem.kernels.tangential import mindlin

from warpdem import Scene, Simulation

PAGE = Path(__file__).resolve().parents[2] / "kernels" / "API.md"
BOX = PAGE.parents[1] / "scenes" / "meshes" / "box.stl"
GLASS = SimpleNamespace(young_modulus=5e6, poisson_ratio=0.3)
STEPS, SETTLED = 1000, 4000


@pytest.fixture(scope="module")
def bed(tmp_path_factory):
    """The program of the page as a module."""
    [(text, name)] = re.findall(r"```python\n(# (bed\.py)\n.*?)```", PAGE.read_text(encoding="utf-8"), re.DOTALL)
    file = tmp_path_factory.mktemp("page") / name
    file.write_text(text)
    spec = importlib.util.spec_from_file_location("bed", file)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def engine(bed, record, *, rolling="none", steps=STEPS, drag=None, **pair) -> Simulation:
    """The same bed by the engine."""
    scene = Scene.model_validate(
        {
            "gravity": bed.GRAVITY,
            "materials": {"g": {"density": bed.DENSITY, "young_modulus": 5e6, "poisson_ratio": 0.3}},
            "contact": {"rolling": rolling},
            "pairs": [{"materials": ["g", "g"], "restitution": 0.5, "friction": 0.4, **pair}],
            "walls": [{"name": "box", "material": "g", "mesh": str(BOX), "scale": bed.EDGE}],
            "grains": [{"material": "g", "positions": record[:, :3], "radii": record[:, 3], "velocities": record[:, 4:7],
                        "spins": record[:, 10:13]}],
            "fields": [{"model": "drag", "parameters": {"coefficient": drag}}] if drag else [],
            "time": {"end": 1.0, "step": bed.DT, "max_speed": 0.5},
        }
    )  # fmt: skip
    sim = Simulation(scene, device="cpu", threads=1)
    sim.step(steps)
    return sim


def own_box(bed, law, record, skin=2e-4, steps=STEPS) -> api.Grains:
    grains = api.Grains(record, bed.DENSITY)
    mesh = bed.build_mesh(bed.trimesh.creation.box(bounds=[[0.0] * 3, [bed.EDGE] * 3]).triangles)
    pairs, walls = api.Pairs(grains, law, skin), api.MeshWall(grains, law, mesh, skin)
    for _ in range(steps):
        pairs.apply(bed.DT)
        walls.apply(bed.DT)
        api.drift(grains, bed.DT, bed.GRAVITY)
    assert pairs.rebuilds > 1 and walls.rebuilds > 1
    return grains


@pytest.fixture(scope="module")
def coupled(bed):
    """Record of the page's program, its grains and temperatures once the bed lies."""
    record = bed.start()
    return (record, *bed.run(record, SETTLED))


def test_the_bed_of_the_page_is_that_of_the_engine_with_its_drag(bed, coupled):
    """To round-off, which the collisions of 4000 steps make 1000 times larger: 3e-13 m."""
    record, grains, _ = coupled
    sim = engine(bed, bed.start(), drag=bed.DRAG, steps=SETTLED)
    np.testing.assert_allclose(record[:, :3], sim.particles.position, rtol=0, atol=1e-10)
    assert len(sim.contacts().i) > 300 and grains.steps == SETTLED


def test_heat_goes_to_grains_that_touch_and_no_other_way(bed, coupled):
    """What is in the grains is what the spot gave: whole steps of its power."""
    _, grains, temperature = coupled
    gained = (temperature.numpy() - 300.0) * grains.mass.numpy() * bed.HEAT
    given = gained.sum() / (bed.POWER * bed.DT)
    assert given > 100.0
    np.testing.assert_allclose(given, np.round(given), rtol=0, atol=1e-6)
    assert ((gained > 0.0) & (gained < 0.5 * bed.POWER * bed.DT)).any(), "no grain is warm by its neighbors alone"


@pytest.mark.parametrize(
    ("name", "model", "keys"),
    [("none", None, {}), ("constant", constant, {"rolling_friction": 0.1}),
     ("spring", spring, {"rolling_friction": 0.1, "rolling_damping": 0.3})],
)  # fmt: skip
def test_every_history_has_the_bits_of_the_engine(bed, name, model, keys):
    record = bed.start()
    record[:, 10:13] = np.random.default_rng(2).normal(0.0, 20.0, (len(record), 3))
    sim = engine(bed, record, rolling=name, **keys)
    law = api.ContactLaw(
        hertz, mindlin, model, materials=[GLASS], pairs={(0, 0): SimpleNamespace(restitution=0.5, friction=0.4, **keys)}
    )
    own_box(bed, law, record)
    np.testing.assert_array_equal(record[:, :3], sim.particles.position)


def test_no_bit_depends_on_the_skin(bed):
    law = api.ContactLaw(hertz, mindlin, materials=[GLASS], pairs={(0, 0): SimpleNamespace(restitution=0.5, friction=0.4)})
    thin, wide = bed.start(), bed.start()
    own_box(bed, law, thin, skin=5e-5, steps=400)
    own_box(bed, law, wide, skin=6e-4, steps=400)
    np.testing.assert_array_equal(thin, wide)


def test_materials_have_their_own_coefficients():
    """Two pairs of grains at one overlap: the forces are those of their materials, without damping at rest."""
    hard = SimpleNamespace(young_modulus=5e7, poisson_ratio=0.3)
    one = SimpleNamespace(restitution=1.0)
    law = api.ContactLaw(hertz, materials=[GLASS, hard], pairs={(0, 0): one, (0, 1): one, (1, 1): one})
    x = np.array([0.0, 1.9e-3, 0.1, 0.1 + 1.9e-3])
    grains = api.Grains(api.records(np.stack([x, 0 * x, 0 * x], axis=1), 1e-3), 2500.0, material=[0, 0, 0, 1])
    api.Pairs(grains, law, 1e-4).apply(1e-6)
    soft, mixed = 5e6 / (2 * 0.91), 1.0 / (0.91 / 5e6 + 0.91 / 5e7)
    expected = [4.0 / 3.0 * e * np.sqrt(0.5e-3) * 1e-4**1.5 for e in (soft, mixed)]
    np.testing.assert_allclose(grains.force.numpy()[[1, 3], 0], expected, rtol=1e-12, atol=0)
    np.testing.assert_array_equal(grains.force.numpy()[[0, 2]], -grains.force.numpy()[[1, 3]])


def test_the_neighbor_list_is_that_of_brute_force(bed):
    record = bed.start()
    law = api.ContactLaw(hertz, materials=[GLASS], pairs={(0, 0): SimpleNamespace(restitution=0.5)})
    grains = api.Grains(record, bed.DENSITY)
    pairs = api.Pairs(grains, law, 1e-3)
    assert pairs.update() and not pairs.update()
    gap = np.linalg.norm(record[:, None, :3] - record[None, :, :3], axis=2) - record[:, 3] - record[:, None, 3]
    i, j = np.nonzero(np.triu(gap < 1e-3, 1))
    np.testing.assert_array_equal(np.stack([pairs.owner.numpy()[:, 0], pairs.partner.numpy()[:, 0]])[
        :, np.lexsort([pairs.partner.numpy()[:, 0], pairs.owner.numpy()[:, 0]])], [i, j])  # fmt: skip
    start, count, neighbor = (a.numpy() for a in (pairs.start, pairs.count, pairs.neighbor))
    for g in range(0, len(record), 50):
        others = np.flatnonzero((gap[g] < 1e-3) & (np.arange(len(gap)) != g))
        np.testing.assert_array_equal(neighbor[start[g] : start[g] + count[g]], others)


# --- memory ----------------------------------------------------------------------------------------------------------


def test_numpy_shares_the_record_and_its_views(bed):
    record = bed.start()
    grains = api.Grains(record, bed.DENSITY)
    for view, columns in ((grains.position, record[:, :3]), (grains.velocity, record[:, 4:7]), (grains.spin, record[:, 10:13])):
        assert np.shares_memory(np.from_dlpack(view), record) and np.shares_memory(view.numpy(), record)
        np.testing.assert_array_equal(np.from_dlpack(view), columns)
    grains.velocity.numpy()[:] = 0.25
    assert (record[:, 4:7] == 0.25).all()
    before = record[:, :3].copy()
    api.drift(grains, 1e-3)
    np.testing.assert_allclose(record[:, :3], before + 0.25e-3, rtol=0, atol=1e-15)
    grains.force.fill_(wp.vec3d(1.0, 2.0, 3.0))
    np.testing.assert_array_equal(np.from_dlpack(grains.load)[0], [1, 2, 3, 0, 0, 0])


def test_torch_shares_both_ways(bed):
    torch = pytest.importorskip("torch")
    record = torch.from_numpy(bed.start().copy())
    grains = api.Grains(record, bed.DENSITY)
    assert grains.record.ptr == record.data_ptr() == torch.from_dlpack(grains.position).data_ptr()
    torch.from_dlpack(grains.velocity)[:] = 0.5
    assert bool((record[:, 4:7] == 0.5).all())


def test_jax_reads_without_a_copy(bed):
    jax = pytest.importorskip("jax")
    jax.config.update("jax_enable_x64", True)
    grains = api.Grains(bed.start(), bed.DENSITY)
    array = jax.dlpack.from_dlpack(grains.mass)
    assert array.unsafe_buffer_pointer() == grains.mass.ptr
    np.testing.assert_array_equal(np.asarray(array), grains.mass.numpy())


# --- mistakes --------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "record", [np.zeros((3, 10)), np.zeros((3, 16), np.float32), np.zeros((16, 3)).T, np.zeros((3, 32))[:, ::2]]
)
def test_another_record_is_refused(record):
    with pytest.raises(ValueError, match=r"shape \(n, 16\) of float64, contiguous, is wanted"):
        api.Grains(record, 1.0)


def test_a_position_that_is_no_number_is_told(bed):
    record = bed.start()
    law = api.ContactLaw(hertz, materials=[GLASS], pairs={(0, 0): SimpleNamespace(restitution=0.5)})
    pairs = api.Pairs(api.Grains(record, bed.DENSITY), law, 1e-4)
    pairs.apply(1e-6)
    record[7, 1] = np.nan
    with pytest.raises(ValueError, match="position of a grain is no number"):
        pairs.apply(1e-6)


def test_one_grain_alone_falls():
    record = api.records(np.zeros((1, 3)), 1e-3)
    grains = api.Grains(record, 2500.0)
    pairs = api.Pairs(grains, api.ContactLaw(hertz, materials=[GLASS], pairs={(0, 0): SimpleNamespace(restitution=1.0)}), 1e-4)
    for _ in range(100):
        pairs.apply(1e-3)
        api.drift(grains, 1e-3, (0.0, 0.0, -10.0))
    np.testing.assert_allclose(record[0, 2], -0.5 * 10.0 * 0.1**2, rtol=1e-13, atol=0)
