"""The state of a run at one time, as writers and pictures read it."""

from dataclasses import dataclass, field, replace

import numpy as np

from warpdem.core.pose import FramePose, Placement


@dataclass(frozen=True)
class TriangleWear:
    """Wear of the triangles of a wall from the time on from which the scene asks for it, shapes (t,)."""

    mean_pressure: np.ndarray
    """Mean normal force over area [Pa]."""
    shear_work: np.ndarray
    """Work of friction over area [J/m2]."""
    impact_work: np.ndarray
    """Work of the normal force over area [J/m2]."""
    archard_depth: np.ndarray | None = None
    """Depth worn off by Archard's law [m]; None if it was not asked for."""
    finnie_depth: np.ndarray | None = None
    """Depth worn off by Finnie's law [m]; None if it was not asked for."""


@dataclass(frozen=True)
class WallLoad:
    """Load of the grains on a wall at one time; vectors in frame axes, or in laboratory axes."""

    force: np.ndarray
    """Force [N], shape (3,)."""
    torque: np.ndarray
    """Torque about ``about`` [N m], shape (3,)."""
    about: np.ndarray
    """Point of the wall's body that the torque refers to [m], shape (3,)."""
    power: float
    """Work that the wall's motion does on the grains in the laboratory, per time [W]: drive power when positive."""
    triangle_force: np.ndarray
    """Force on each triangle of a mesh [N], shape (t, 3); empty for other walls."""
    pressure: np.ndarray
    """Normal force over area of each triangle of a mesh [Pa], shape (t,); positive in compression."""
    wear: TriangleWear | None = None
    """Wear of the triangles of a mesh, in [Pa], [J] and [m] as its columns say; None where the scene does not ask for it."""

    def __repr__(self) -> str:
        force, torque = (", ".join(f"{x:.4g}" for x in vector) for vector in (self.force, self.torque))
        return f"<WallLoad: force ({force}) N, torque ({torque}) N m, power {self.power:.4g} W>"

    def in_laboratory(self, frame: FramePose) -> "WallLoad":
        """The same load, vectors rotated from frame axes to laboratory axes."""
        rotated = {name: getattr(self, name) @ frame.rotation.T for name in ("force", "torque", "triangle_force")}
        return replace(self, **rotated, about=frame.to_laboratory(self.about))


@dataclass(frozen=True)
class ContactNetwork:
    """The contacts at one time as lines, grain-grain first, then grain-wall, each ordered by ids; vectors in frame axes.

    The line of a contact of two grains runs from the centre of i, the grain of the lower id, to the centre of j (its nearest
    image if the domain is periodic); the line of a contact with a wall runs from the centre of i to the contact point.
    """

    i: np.ndarray
    """Id of the grain, shape (c,), int64."""
    j: np.ndarray
    """Id of the other grain, -1 for a wall, shape (c,), int64."""
    wall: np.ndarray
    """Number of the wall in the order of the scene, -1 for a grain, shape (c,), int32."""
    start: np.ndarray
    """Centre of i [m], shape (c, 3)."""
    end: np.ndarray
    """Centre of j, or contact point at the wall [m], shape (c, 3)."""
    force: np.ndarray
    """Force on i [N], shape (c, 3)."""
    normal_force: np.ndarray
    """Component of the force along the normal [N], positive when repulsive, shape (c,)."""
    friction_force: np.ndarray
    """Tangential force on i, in the contact plane [N], shape (c, 3)."""
    overlap: np.ndarray
    """Overlap [m], shape (c,)."""
    sliding: np.ndarray
    """1 where the friction force has reached the Coulomb limit, else 0, shape (c,), int8."""
    damping_force: np.ndarray | None = None
    """Part of the force that is not of the springs [N], shape (c, 3); None where it was not asked for."""
    bridge: np.ndarray | None = None
    """Liquid in the bridge [m3], 0 without one, shape (c,); None in a run without liquid."""


@dataclass(frozen=True)
class ClumpShots:
    """The clumps at one time, ordered by id; vectors in frame axes, motion relative to the frame."""

    id: np.ndarray
    """Ids: those of their first members, shape (c,), int64, ascending."""
    type: np.ndarray
    """Number of the clump in the order of the scene, shape (c,), int32."""
    members: np.ndarray
    """Number of members, shape (c,), int32."""
    mass: np.ndarray
    """Mass [kg], shape (c,)."""
    radius: np.ndarray
    """Radius of the sphere of equal volume [m], shape (c,)."""
    position: np.ndarray
    """Centre of mass [m], shape (c, 3)."""
    orientation: np.ndarray
    """Unit quaternions (w, x, y, z) from the axes of the clump in the scene to the frame axes, shape (c, 4)."""
    velocity: np.ndarray
    """Velocity of the centre [m/s], shape (c, 3)."""
    spin: np.ndarray
    """Angular velocity [rad/s], shape (c, 3)."""
    angular_momentum: np.ndarray
    """Absolute angular momentum about the centre [N m s], shape (c, 3)."""


@dataclass(frozen=True)
class Snapshot:
    """State of a run at time t_k, ordered by grain id; vectors in frame axes, motion relative to the frame."""

    step: int
    time: float
    """Time [s]."""
    frame: FramePose
    id: np.ndarray
    """Grain ids, shape (n,), int64, ascending."""
    type: np.ndarray
    """Material index in the order of the scene, shape (n,), int32."""
    group: np.ndarray
    """Number of the group, of those of ``Scene.groups``, shape (n,), int32."""
    radius: np.ndarray
    """Radius [m], shape (n,)."""
    mass: np.ndarray
    """Mass [kg], shape (n,)."""
    position: np.ndarray
    """Position [m], shape (n, 3)."""
    velocity: np.ndarray
    """Velocity relative to the frame [m/s], shape (n, 3)."""
    spin: np.ndarray
    """Angular velocity relative to the frame [rad/s], shape (n, 3)."""
    force: np.ndarray
    """Contact force on each grain [N], shape (n, 3)."""
    walls: dict[str, Placement] = field(default_factory=dict)
    """Placement of each wall in frame axes, by wall name."""
    loads: dict[str, WallLoad] = field(default_factory=dict)
    """Load on each wall in frame axes, by wall name; empty when the scene leaves them out."""
    orientation: np.ndarray | None = None
    """Unit quaternions (w, x, y, z) from body axes to frame axes, shape (n, 4); None when the scene leaves them out."""
    contacts: ContactNetwork | None = None
    """The contacts; None when the scene leaves them out."""
    clump: np.ndarray | None = None
    """Id of the clump of each grain, -1 for a grain of its own, shape (n,), int64; None in a run without clumps."""
    clumps: ClumpShots | None = None
    """The clumps; None in a run without any."""
    liquid: np.ndarray | None = None
    """Liquid on each grain, without that in bridges [m3], shape (n,); None in a run without liquid."""
    gravity: np.ndarray | None = None
    """Gravity in laboratory axes [m/s2], shape (3,); None where results do not hold it."""


@dataclass(frozen=True)
class WallMesh:
    """A mesh wall in its body axes; the snapshot's ``walls`` hold its placement at any time."""

    name: str
    vertices: np.ndarray
    """Corners [m], shape (v, 3), float64."""
    triangles: np.ndarray
    """Corner numbers of each triangle, shape (t, 3), int32."""
    infinite: bool = False
    """Whether this is a patch of an infinite plane, cut to the part that is drawn."""


def in_laboratory(snapshot: Snapshot) -> Snapshot:
    """The same grains and contacts in laboratory axes, velocities and spins absolute; forces on walls stay as they are.

    With R and o the frame's rotation and origin, u and w its velocity and angular velocity in its own axes:

        position   R q + o
        velocity   R (v + u + w x q),     spin   R (s + w)
    """
    frame, contacts = snapshot.frame, snapshot.contacts
    to_laboratory = frame.rotation.T
    if contacts is not None:
        names = ("force", "friction_force", *(("damping_force",) if contacts.damping_force is not None else ()))
        vectors = {name: getattr(contacts, name) @ to_laboratory for name in names}
        places = {name: frame.to_laboratory(getattr(contacts, name)) for name in ("start", "end")}
        contacts = replace(contacts, **vectors, **places)
    return replace(
        snapshot,
        position=frame.to_laboratory(snapshot.position),
        velocity=(snapshot.velocity + frame.velocity_at(snapshot.position)) @ to_laboratory,
        spin=(snapshot.spin + frame.spin) @ to_laboratory,
        force=snapshot.force @ to_laboratory,
        contacts=contacts,
    )
