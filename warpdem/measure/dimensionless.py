"""Dimensionless numbers of a run in rotating equipment, gathered while it runs.

    Ro = v / (2 w R sin(phi)) with sin(phi) = 1,     Fr = w^2 R / g

    w    rms angular velocity [rad/s]
    v    rms speed of the grains relative to the rotating axes, by mass [m/s]
    R    largest distance of a grain's centre from the axis [m]
    g    gravity [m/s2]

rms and largest are taken over all times added at which the axes rotate; the others (the hourglass after its half turn) say
nothing about the rotation. The axes are the frame's; in a scene whose frame never rotates they are those of the wall that
rotates fastest. The axis is the instantaneous one, along w where the axes' points move along w only: for nested rotations
it is neither of the scene's axes.

Ro is eq. 7 of Delacroix et al. 2020, who leave v, L and phi to the reader: here L = R, and phi = 90 degrees, which takes the
flow as normal to the axis. Ro well below 1: the Coriolis force governs; above 1: it hardly matters. Fr is that of drums
(Mellmann 2001): about 1 where grains begin to centrifuge, at a horizontal axis.
"""

import functools
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from warpdem.core.rigid_motion import compose
from warpdem.measure.observers import Particles
from warpdem.measure.part import Part
from warpdem.measure.sums import reader_of
from warpdem.measure.totals import Totals
from warpdem.scene.model import Scene
from warpdem.scene.motion_chain import Chain, frame_chain, wall_chain


@dataclass(frozen=True)
class Turning:
    """What a run showed of its rotation."""

    axes: str
    """What rotates: "frame" or "wall NAME"."""
    angular_velocity: float
    """w [rad/s]."""
    speed: float
    """v [m/s]."""
    radius: float
    """R [m]."""
    rossby: float | None
    """Ro [-]; None if all grains lie on the axis."""
    froude: float | None
    """Fr [-]; None without gravity."""


def rotating_axes(scene: Scene) -> tuple[str, list[Chain]] | None:
    """Name of the axes that the numbers of ``scene`` refer to, and their motions, outermost first; None if none rotate."""
    frame = frame_chain(scene)
    if frame.rotates:
        return "frame", [frame]
    walls = [(wall, wall_chain(scene, number)) for number, wall in enumerate(scene.walls)]
    turning = [(wall, chain) for wall, chain in walls if chain.rotates]
    if not turning:
        return None
    wall, chain = max(turning, key=lambda item: item[1].max_rate)
    return f"wall {wall.name}", [frame, chain] if wall.fixed_to == "frame" else [chain]


class Axes(NamedTuple):
    """Axes that rotate, at one time."""

    spin: np.ndarray
    """Angular velocity along the axes [rad/s], shape (3,)."""
    velocity: np.ndarray
    """Velocity of the origin along the axes [m/s], shape (3,)."""
    axes: np.ndarray
    """From the axes to the laboratory, shape (3, 3)."""
    origin: np.ndarray
    """In the laboratory [m], shape (3,)."""

    @property
    def rate(self) -> float:
        """Size of the angular velocity [rad/s]."""
        return float(np.linalg.norm(self.spin))


def own_motion(part: Part, axes: Axes) -> tuple[np.ndarray, float]:
    """``digits`` of mass and mass times square of relative speed of the grains of a process; their largest distance [m]."""
    p, own = Particles(part.view), part.view.state.rank < part.view.state.owned
    mass, place = p.mass[own], (p.position_lab[own] - axes.origin) @ axes.axes
    carried = axes.velocity + np.cross(axes.spin, place)
    relative = p.velocity_lab[own] @ axes.axes - carried
    # |w x (u + w x q)| = w^2 times the distance from the line on which u + w x q is along w
    distance = np.linalg.norm(np.cross(axes.spin, carried), axis=1) / axes.rate**2
    square = mass * np.einsum("ij,ij->i", relative, relative)
    return part.reader.column_digits(mass, square), float(distance.max(initial=0.0))


class TurningNumbers:
    """Sums over times of a run.

    After a resume the sums start afresh.

    Args:
        scene: what is run.
    """

    def __init__(self, scene: Scene) -> None:
        self.scene = scene
        self.axes, self.motions = rotating_axes(scene) or ("", [])
        self.times, self.square_rate, self.square_speed, self.radius = 0, 0.0, 0.0, 0.0

    def add(self, now: Totals) -> None:
        """Take in one time of a run of the scene, unless the axes rest at it."""
        if not self.motions or not now.count:
            return
        time = np.array([now.view.clock.time])
        pose = functools.reduce(compose, [motion.pose(time) for motion in self.motions])
        axes = Axes(*(values[0].astype(float) for values in (pose.spin, pose.velocity, pose.axes, pose.origin)))
        if axes.rate == 0.0:
            return
        found = now.each(functools.partial(own_motion, axes=axes))
        mass, square = reader_of(now.view).rounded([digits for digits, _ in found]).tolist()
        self.times += 1
        self.square_rate += axes.rate**2
        self.square_speed += square / mass
        self.radius = max(self.radius, *(radius for _, radius in found))

    def result(self) -> Turning | None:
        """The numbers of all times so far; None if nothing rotated at any of them."""
        if self.times == 0:
            return None
        rate, speed = (float(np.sqrt(s / self.times)) for s in (self.square_rate, self.square_speed))
        gravity = float(np.linalg.norm(self.scene.gravity))
        return Turning(
            axes=self.axes,
            angular_velocity=rate,
            speed=speed,
            radius=self.radius,
            rossby=speed / (2.0 * rate * self.radius) if self.radius > 0 else None,
            froude=rate**2 * self.radius / gravity if gravity > 0 else None,
        )
