"""State of grains in arrays of your own."""

import numpy as np
import warp as wp
from warpdem.kernels import grain

Load = wp.types.vector(6, wp.float64)
Pair = wp.types.vector(2, wp.float64)
Record = grain.build(True).Record
"""What ``Grains`` holds per grain, 16 float64: see ``warpdem.kernels.grain``."""


def records(position, radius, velocity=0.0, spin=0.0) -> np.ndarray:
    """Records of grains at rest in their axes' past: accelerations are zero.

    Args:
        position: positions [m], shape (n, 3).
        radius: radii [m], shape (n,) or one number.
        velocity: velocities [m/s], shape (n, 3) or one number.
        spin: angular velocities [rad/s], shape (n, 3) or one number.

    Returns:
        Shape (n, 16), float64: columns as in ``warpdem.kernels.grain``.
    """
    out = np.zeros((len(position), 16))
    out[:, grain.POSITION], out[:, grain.RADIUS] = position, radius
    out[:, grain.VELOCITY], out[:, grain.SPIN] = velocity, spin
    return out


class Grains:
    """State of the grains, in arrays that may be yours, and what acts on them.

    Velocity and spin are those half a step before the present time, as the kick-drift scheme holds them; before the first
    step they are those of the start.

    Args:
        record: shape (n, 16) float64 or (n,) ``Record``, contiguous. A ``wp.array``, or any array that speaks DLPack; its
            memory is used, not copied, so it has to be writable and stays alive with this object.
        density: densities [kg/m3], shape (n,) or one number.
        material: index of each grain's material in the contact law, shape (n,) or one number.

    Attributes:
        record: ``wp.array`` of ``Record``, shape (n,).
        position: view of the record [m], ``wp.array`` of ``wp.vec3d``, shape (n,); likewise the next four.
        velocity: [m/s].
        acceleration: of the last step [m/s2].
        spin: [rad/s].
        angular_acceleration: of the last step [rad/s2].
        radius: view of the record [m], ``wp.array`` of ``wp.float64``, shape (n,).
        mass: [kg], ``wp.array`` of ``wp.float64``, shape (n,).
        load: force [N] and torque [N m] of each grain, ``wp.array`` of six ``wp.float64``, shape (n,).
        force: view of the load [N], ``wp.array`` of ``wp.vec3d``, shape (n,).
        torque: view of the load [N m], ``wp.array`` of ``wp.vec3d``, shape (n,).
        steps: how often ``drift`` was called.

    Raises:
        ValueError: the record has another shape or type.
    """

    def __init__(self, record, density, material=0) -> None:
        wp.init()
        given = record if isinstance(record, wp.array) else wp.from_dlpack(record)
        wanted = given.dtype is Record or (given.dtype is wp.float64 and given.ndim == 2 and given.shape[1] == 16)
        if not wanted or not given.is_contiguous:
            raise ValueError(f"record: shape (n, 16) of float64, contiguous, is wanted, not {given.shape} of {given.dtype}")
        self._given, self.device, n = given, given.device, given.shape[0]
        self.record = wp.array(ptr=given.ptr, shape=n, dtype=Record, device=self.device)
        self.position, self.velocity = self._column(0), self._column(4)
        self.acceleration, self.spin, self.angular_acceleration = self._column(7), self._column(10), self._column(13)
        self.radius = self._column(3, wp.float64)
        radius = self.radius.numpy()
        mass = density * 4.0 / 3.0 * np.pi * radius**3
        self.mass = wp.array(mass, dtype=wp.float64, device=self.device)
        self.inverse = wp.array(np.stack([1.0 / mass, 2.5 / (mass * radius**2)], axis=1), dtype=Pair, device=self.device)
        self.material = wp.array(np.broadcast_to(material, n).astype(np.int32), dtype=wp.int32, device=self.device)
        self.id = wp.array(np.arange(n), dtype=wp.int64, device=self.device)
        self.load = wp.zeros(n, dtype=Load, device=self.device)
        self.force, self.torque = self._column(0, of=self.load), self._column(3, of=self.load)
        self.steps = 0

    def __len__(self) -> int:
        return self.record.shape[0]

    def _column(self, first: int, dtype=wp.vec3d, of=None) -> wp.array:
        """View of the numbers from ``first`` on of each grain."""
        of = self.record if of is None else of
        return wp.array(
            ptr=of.ptr + 8 * first, shape=of.shape[0], strides=(of.strides[0],), dtype=dtype, device=self.device
        )
