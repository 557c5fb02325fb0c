"""Fixtures that all tests share: devices, precisions, small scenes; and the option --slow."""

from contextlib import contextmanager

import pytest
import warp as wp

from costs import Costs, longest_first
from warpdem import Scene, Simulation

wp.config.quiet = True


def pytest_addoption(parser):
    parser.addoption("--slow", action="store_true", help="also run the tests marked slow (minutes)")
    parser.addoption("--costs", action="store_true", help="say which files cost most, and what of it is compiling")


def pytest_configure(config):
    if config.getoption("--costs"):
        config.pluginmanager.register(Costs())


def pytest_collection_modifyitems(config, items):
    if hasattr(config, "workerinput"):  # a worker of xdist; all of them have the same order
        longest_first(items)
    if config.getoption("--slow"):
        return
    for item in items:
        if "slow" in item.keywords:
            item.add_marker(pytest.mark.skip(reason="slow: run with --slow"))


@pytest.fixture(params=["cpu", "cuda:0"])
def device(request):
    """Name of the device; a test that takes it runs on the CPU and, where there is one, on a GPU."""
    wp.init()
    if request.param not in [d.alias for d in wp.get_devices()]:
        pytest.skip(f"no device {request.param} on this machine")
    return request.param


@pytest.fixture
def file_size_limit():
    """A context in which no file grows beyond a size [B]: the nearest that a test comes to a full disk."""
    resource = pytest.importorskip("resource", reason="the system has no limit on the size of files")

    @contextmanager
    def limit(size: int):
        soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
        resource.setrlimit(resource.RLIMIT_FSIZE, (size, hard))
        try:
            yield
        finally:
            resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))

    return limit


@pytest.fixture(params=[wp.float32, wp.float64], ids=["float32", "float64"])
def real(request):
    """Scalar type that a model is built for."""
    return request.param


def scene_of(
    positions,
    *,
    step,
    radius=1e-3,
    velocities=None,
    spins=None,
    velocities_in="frame",
    gravity=(0.0, 0.0, 0.0),
    density=2500.0,
    young_modulus=5e6,
    poisson_ratio=0.3,
    normal="hertz",
    tangential="none",
    rolling="none",
    restitution=0.5,
    walls=(),
    frame=None,
    fields=(),
    max_speed=1e-3,
    engine=None,
    **pair,
):
    """A scene of one material and explicit grains; keys of the pair law that are not named go into ``pair``.

    ``max_speed`` is small by default: these tests choose their time steps by other rules than the stability limit.
    """
    grains = {"material": "g", "positions": positions, "velocities_in": velocities_in}
    grains["radius" if isinstance(radius, float) else "radii"] = radius
    grains |= {} if velocities is None else {"velocities": velocities}
    grains |= {} if spins is None else {"spins": spins}
    material = {"density": density, "young_modulus": young_modulus, "poisson_ratio": poisson_ratio}
    return Scene.model_validate(
        {
            "gravity": gravity,
            "materials": {"g": material},
            "contact": {"normal": normal, "tangential": tangential, "rolling": rolling},
            "pairs": [{"materials": ["g", "g"], "restitution": restitution, **pair}],
            "grains": [grains],
            "walls": [{"material": "g", **wall} for wall in walls],
            "frame": frame,
            "fields": list(fields),
            "time": {"end": 1.0, "step": step, "max_speed": max_speed},
            "engine": engine or {},
        }
    )


@pytest.fixture
def make_scene():
    """The function ``scene_of``: a scene of one material and explicit grains."""
    return scene_of


@pytest.fixture
def make_simulation(device):
    """A function of the arguments of ``scene_of`` that returns the simulation on the test's device."""

    def make(*args, threads=1, **keys):
        return Simulation(scene_of(*args, **keys), device=device, threads=threads)

    return make
