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

import numpy as np

from warpdem.core.rigid_motion import compose
from warpdem.measure.observers import Particles
from warpdem.scene.model import Scene
from warpdem.scene.motion_chain import Chain, frame_chain, wall_chain
from warpdem.state.view import RunView


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

    def add(self, view: RunView) -> None:
        """Take in one time of a run of the scene, unless the axes rest at it."""
        if not self.motions or not len(view.state):
            return
        now = np.array([view.clock.time])
        pose = functools.reduce(compose, [motion.pose(now) for motion in self.motions])
        spin, velocity, axes, origin = (
            values[0].astype(float) for values in (pose.spin, pose.velocity, pose.axes, pose.origin)
        )
        rate = float(np.linalg.norm(spin))
        if rate == 0.0:
            return
        p = Particles(view)
        mass, place = p.mass, (p.position_lab - origin) @ axes
        carried = velocity + np.cross(spin, place)
        relative = p.velocity_lab @ axes - carried
        # |w x (u + w x q)| = w^2 times the distance from the line on which u + w x q is along w
        distance = np.linalg.norm(np.cross(spin, carried), axis=1) / rate**2
        self.times += 1
        self.square_rate += rate**2
        self.square_speed += float(mass @ np.sum(relative**2, axis=1) / mass.sum())
        self.radius = max(self.radius, float(distance.max()))

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
