"""Wear of walls and their mean pressure, from the sums of ``kernels.measure.wear``."""

from dataclasses import dataclass

import numpy as np

from warpdem.core.snapshot import TriangleWear
from warpdem.kernels.measure.wear import SUMS
from warpdem.measure.totals import Totals
from warpdem.measure.wall_loads import areas
from warpdem.scene.model import Scene
from warpdem.scene.wear import Wear
from warpdem.state.view import RunView


@dataclass(frozen=True)
class WallWear:
    """What wore one wall from ``measures.wear.start`` on; arrays have one number per triangle, or one for an analytic wall."""

    time: float
    """Duration that has been added up [s]."""
    area: np.ndarray
    """Area of each triangle [m2]; nan for an analytic wall."""
    normal_impulse: np.ndarray
    """Sum of normal force times time step [N s]."""
    shear_work: np.ndarray
    """Work of friction on the relative motion that it took away [J]."""
    impact_work: np.ndarray
    """The same of the normal force [J]."""
    sliding: np.ndarray
    """Integral of normal force times sliding speed [J]."""
    erosion: np.ndarray
    """Sum of m u^2 f(a) over impacts [J]."""
    asked: Wear
    """Laws of the scene."""

    @property
    def mean_pressure(self) -> np.ndarray:
        """Mean normal force over area [Pa]; nan before anything has been added up."""
        return self.normal_impulse / (self.time * self.area) if self.time > 0.0 else np.full_like(self.area, np.nan)

    @property
    def archard_volume(self) -> np.ndarray | None:
        """Volume worn off by Archard's law [m3]; None if the scene does not ask for it."""
        law = self.asked.archard
        return None if law is None else law.coefficient / law.hardness * self.sliding

    @property
    def finnie_volume(self) -> np.ndarray | None:
        """Volume worn off by Finnie's law [m3]; None if the scene does not ask for it."""
        law = self.asked.finnie
        return None if law is None else self.erosion / (law.depth_ratio * law.force_ratio * law.pressure)

    def of_triangles(self) -> TriangleWear:
        """The same over the area of each triangle."""
        depths = [None if v is None else v / self.area for v in (self.archard_volume, self.finnie_volume)]
        work = self.shear_work / self.area, self.impact_work / self.area
        return TriangleWear(np.nan_to_num(self.mean_pressure), *work, *depths)


def added_time(view: RunView) -> float:
    """Time that the sums of wear stand for [s]: the first kick of a run is half a step, those that follow whole ones."""
    first, step, dt = first_step(view.model.scene, view.clock.dt), view.clock.step_number, view.clock.dt
    return max(0.0, step - (0.5 if first == 0 else first)) * dt


def first_step(scene: Scene, dt: float) -> int:
    """First step that wear counts."""
    assert scene.measures.wear is not None
    return round(scene.measures.wear.start / dt)


def read_wear(view: RunView, now: Totals | None = None) -> dict[str, WallWear]:
    """Wear of each wall up to the time of the view, by name; empty where the scene does not ask for it.

    Args:
        view: the run.
        now: sums over its grains at that time, where a reader has them already.
    """
    model, asked = view.model, view.model.scene.measures.wear
    if asked is None or model.walls is None:
        return {}
    sums = (now or Totals(view)).worn
    out = {}
    for number, wall in enumerate(model.scene.walls):
        own = sums[model.walls.wall_of == number]
        mesh = model.meshes.get(wall.name)
        area = areas(mesh) if mesh is not None else np.full(len(own), np.nan)
        columns = {name: own[:, SUMS.of(name)] for name in SUMS.names}
        out[wall.name] = WallWear(added_time(view), area, **columns, asked=asked)
    return out
