"""Read-only measures of a run: grains, contacts, energies."""

from dataclasses import dataclass

import numpy as np
import warp as wp

from warpdem.errors import SceneError
from warpdem.kernels import grain
from warpdem.kernels.contact.columns import LOAD
from warpdem.model.features import field_numbers
from warpdem.model.impact import elastic_energy, own_constants, own_of, secant, stiffness
from warpdem.model.model import Model
from warpdem.scene.models import model
from warpdem.state.particles import unturned
from warpdem.state.view import RunView

LEAST_OVERLAP = 1.0e-100  # [m]: a law that acts beyond contact has contacts of none; its square is not yet zero


class Particles:
    """The grains of a run at one time t_k, ordered by id; NumPy arrays are fresh copies.

    Velocities are those of t_k as the integrator completes its step: for exact_drift V_k = V + (dt/2) a_k.
    """

    def __init__(self, view: RunView) -> None:
        self._view = view
        self._state = view.state
        self._pose = view.model.schedule.pose(view.clock.time)
        self._read_at = -1

    def _readings(self) -> tuple[np.ndarray, ...]:
        """Readings of the present step, made once for all properties."""
        if self._read_at != self._view.clock.step_number:
            self._read, self._read_at = self._view.readings(), self._view.clock.step_number
        return self._read

    @property
    def id(self) -> np.ndarray:
        """Ids, shape (n,), int64, ascending."""
        return self._state.ids

    @property
    def type(self) -> np.ndarray:
        """Material index in the order of the scene, shape (n,), int32."""
        return self._state.kind.numpy()[self._state.rank]

    @property
    def group(self) -> np.ndarray:
        """Number of the group, of those of ``Scene.groups``, shape (n,), int32."""
        return self._state.group[self._state.rank]

    @property
    def orientation(self) -> np.ndarray:
        """Unit quaternions (w, x, y, z) from body axes to frame axes, shape (n, 4); body axes are frame axes at the start.

        All grains are unturned while nothing turns them.

        Raises:
            SceneError: the scene does not ask for it with output.orientation = true.
        """
        scene = self._view.model.scene
        if not scene.output.orientation:
            raise SceneError(f"{scene.source}: output.orientation = false: how grains turn is not kept")
        if self._state.orientation is None:
            return unturned(len(self._state))
        return self._state.orientation.numpy()[self._state.rank]

    @property
    def radius(self) -> np.ndarray:
        """Radius [m], shape (n,)."""
        return self._state.by_id(grain.RADIUS)

    @property
    def mass(self) -> np.ndarray:
        """Mass [kg], shape (n,)."""
        return 1.0 / self._state.inverse.numpy()[self._state.rank, 0]

    @property
    def inertia(self) -> np.ndarray:
        """Moment of inertia (2/5) m R^2 [kg m2], shape (n,)."""
        return 1.0 / self._state.inverse.numpy()[self._state.rank, 1]

    @property
    def position(self) -> np.ndarray:
        """Position in frame axes [m], shape (n, 3)."""
        return self._state.by_id(grain.POSITION)

    @property
    def force(self) -> np.ndarray:
        """Contact force in frame axes [N], shape (n, 3)."""
        return self._readings()[0].copy()

    @property
    def position_lab(self) -> np.ndarray:
        """Position in the laboratory [m], shape (n, 3)."""
        return self._pose.to_laboratory(self.position)

    def _absolute_velocity(self) -> np.ndarray:
        velocity = self._readings()[2]
        if not self._view.model.features.backend.scheme.RELATIVE:
            return velocity
        omega, origin = self._frame_before()
        return velocity + origin + np.cross(omega, self.position)

    def _absolute_spin(self) -> np.ndarray:
        if not self._state.spins:
            return np.zeros((len(self._state), 3))
        spin = self._readings()[3]
        return spin + self._frame_before()[0] if self._view.model.features.backend.scheme.RELATIVE else spin

    def _frame_before(self) -> tuple[np.ndarray, np.ndarray]:
        """Angular velocity of the frame and velocity of its origin just before the instant, in frame axes."""
        row = self._view.model.schedule.frames(self._view.clock.step_number, 0)[0]
        return row[12:15], row[15:18]

    @property
    def velocity(self) -> np.ndarray:
        """Velocity relative to the frame, in frame axes [m/s], shape (n, 3): V - u - w x q of the frame."""
        return self._absolute_velocity() - self._pose.velocity_at(self.position)

    @property
    def velocity_lab(self) -> np.ndarray:
        """Velocity in the laboratory [m/s], shape (n, 3)."""
        return self._absolute_velocity() @ self._pose.rotation.T

    @property
    def spin(self) -> np.ndarray:
        """Angular velocity relative to the frame, in frame axes [rad/s], shape (n, 3): W - w of the frame."""
        if not self._state.spins:
            return np.zeros((len(self._state), 3))
        return self._absolute_spin() - self._pose.spin

    @property
    def spin_lab(self) -> np.ndarray:
        """Angular velocity in the laboratory [rad/s], shape (n, 3)."""
        return self._absolute_spin() @ self._pose.rotation.T


@dataclass(frozen=True)
class Contacts:
    """Touching pairs, grain-grain first, then grain-wall, each by ids; vectors in frame axes.

    ``j`` is the partner's id, or -1 - w for wall w of the scene.
    """

    i: np.ndarray
    j: np.ndarray
    overlap: np.ndarray
    """Overlap [m], shape (c,)."""
    normal: np.ndarray
    """Unit vector from j to i, shape (c, 3)."""
    force: np.ndarray
    """Force on i [N], shape (c, 3)."""
    spring: np.ndarray
    """Tangential spring [m], shape (c, 3)."""
    point: np.ndarray
    """Contact point [m], shape (c, 3)."""
    share: np.ndarray
    """Overlap over the smaller radius [-], shape (c,)."""
    stiffness: np.ndarray
    """Stiffness constant of the normal law, in its own unit (a linear spring's k [N/m]), shape (c,)."""
    angle: np.ndarray
    """Rolling spring [rad], shape (c, 3)."""
    radius: np.ndarray
    """R* [m], the grain's at a wall, shape (c,)."""
    weight: np.ndarray
    """Fraction of a full contact, below 1 where neighboring facets of a wall carry a grain together [-], shape (c,)."""
    load: np.ndarray
    """Coulomb load of the force call, which friction is limited by [N], shape (c,)."""
    own: dict[str, np.ndarray]
    """The normal law's own constants and history by name [of the law], each of shape (c,)."""

    def worst(self) -> str:
        """The deepest contact in words."""
        c = int(np.argmax(self.share))
        partner = f"grain {self.j[c]}" if self.j[c] >= 0 else f"wall {-1 - self.j[c]}"
        place = ", ".join(f"{x:.4g}" for x in self.point[c])
        return f"Deepest now: grain {self.i[c]} with {partner} at ({place}) m, {self.share[c]:.3g} of the radius."


def read_contacts(view: RunView, since: int = 0) -> Contacts:
    """Contacts of a run at the time of the view, from the results of its last force call, ``since`` steps ago."""
    lists, state, run = view.contacts, view.state, view.model
    plan = run.features
    record, ids = state.record.numpy(), state.id.numpy()
    position, radius = record[:, grain.POSITION], record[:, grain.RADIUS]
    parts = []
    if len(state) and lists.contact_count:
        assert lists.owner is not None and lists.partner is not None and lists.slot_i is not None
        assert lists.row is not None and lists.history is not None
        lanes = lists.real_lanes()

        def flat(array: wp.array) -> np.ndarray:  # (batches, fields, lanes) -> (contacts, fields)
            return array.numpy().transpose(0, 2, 1).reshape(-1, array.shape[1])[lanes]

        a, b = lists.owner.numpy().ravel()[lanes], lists.partner.numpy().ravel()[lanes]
        way = run.domain.nearest(position[a] - position[b])
        distance = np.linalg.norm(way, axis=1)
        overlap = radius[a] + radius[b] - distance
        on = overlap > -plan.contact.gap
        a, b, way, distance, overlap = a[on], b[on], way[on], distance[on], overlap[on]
        normal = way / distance[:, None]
        memory, constants, at = flat(lists.history)[on], flat(lists.constants())[on], plan.contact.history
        history = {name: memory[:, at.of(name)] for name in at.names}
        parts.append(
            (
                ids[a], ids[b], overlap, normal, lists.row.numpy()[lists.slot_i.numpy().ravel()[lanes]][on][:, :3],
                history.get("spring", np.zeros((len(a), 3))),
                position[a] - normal * (radius[a] - 0.5 * overlap)[:, None], overlap / np.minimum(radius[a], radius[b]),
                constants[:, plan.contact.constants.stiffness], history.get("angle", np.zeros((len(a), 3))),
                radius[a] * radius[b] / (radius[a] + radius[b]), np.ones(len(a)), history.get(LOAD, np.zeros(len(a))),
                *(constants[:, plan.contact.constants.of(name)] for name in plan.contact.own_constants),
                *(history[name] for name in plan.contact.own_history),
            )
        )  # fmt: skip
    if len(state) and run.walls is not None and lists.row_count:
        parity = (view.clock.step_number - since) & 1
        slot, g = lists.place_slots(parity, lists.wall_grains)
        place = lists.places(parity, slot)
        overlap, normal, wall = place["overlap"], place["normal"], place["wall"]
        spring = place.get("spring", np.zeros((len(g), 3)))
        table, kind = run.coefficient_table, state.kind.numpy()[g]
        material = run.walls.material[wall]
        which = kind * plan.contact.materials + material if plan.contact.table else np.zeros(len(g), dtype=int)
        # the law is linear in its constant: a place that carries part of a force has that part of it
        law = plan.contact
        base = stiffness(law.normal, table[which, law.coefficients.stiffness], radius[g]) * place["weight"]
        own = own_constants(law.normal, own_of(law.normal, table[which]), radius[g])
        parts.append(
            (
                ids[g], -1 - wall, overlap, normal, place["force"], spring,
                position[g] - normal * (radius[g] - overlap)[:, None], overlap / radius[g], base,
                place.get("angle", np.zeros((len(g), 3))), radius[g], place["weight"],
                place[LOAD] * place["weight"] if LOAD in place else np.zeros(len(g)),
                *(own[name] for name in plan.contact.own_constants), *(place[name] for name in plan.contact.own_history),
            )
        )  # fmt: skip
    names = (*plan.contact.own_constants, *plan.contact.own_history)
    if not parts:
        empty, vectors = np.zeros(0), np.zeros((0, 3))
        return Contacts(
            np.zeros(0, dtype=np.int64), np.zeros(0, dtype=np.int64), empty, vectors, vectors, vectors, vectors, empty,
            empty, vectors, empty, empty, empty, dict.fromkeys(names, empty),
        )  # fmt: skip
    columns = [np.concatenate(column) for column in zip(*parts, strict=True)]
    order = np.lexsort((columns[1], columns[0], columns[1] < 0))  # stable: the places of a grain on a wall keep theirs
    columns = [column[order] for column in columns]
    i, j, overlap, normal, force, spring, point, share, base, angle, radius, weight, load, *of_law = columns
    if LOAD not in plan.contact.history:  # a law without numbers of its own
        load = np.maximum(np.einsum("ij,ij->i", force, normal), 0.0)
    own = dict(zip(names, of_law, strict=True))
    return Contacts(i, j, overlap, normal, force, spring, point, share, base, angle, radius, weight, load, own)


def energy(view: RunView) -> dict[str, float]:
    """Energies in the laboratory [J].

    kinetic (1/2) m V^2, rotational (1/2) I W^2, elastic of the normal contacts, of the tangential springs (1/2) k_t s^2 and
    of the rolling springs, potential -m g . x; and, where the scene has external fields with a potential, theirs at the
    present positions.
    """
    p = Particles(view)
    elastic = elastic_energies(view, read_contacts(view))
    velocity, spin = p.velocity_lab, p.spin_lab
    out = {
        "kinetic": float(0.5 * np.sum(p.mass * np.einsum("ij,ij->i", velocity, velocity))),
        "rotational": float(0.5 * np.sum(p.inertia * np.einsum("ij,ij->i", spin, spin))),
        "elastic": float(sum(energies.sum() for energies in elastic.values())),
        "potential": float(-np.sum(p.mass * (p.position_lab @ np.array(view.model.scene.gravity)))),
    }
    fields = field_energies(view.model, p.position, p.position_lab, p.mass, p.radius)
    return {**out, "fields": sum(fields)} if fields else out


def elastic_energies(view: RunView, contacts: Contacts) -> dict[str, np.ndarray]:
    """Energy in the normal contact, the tangential and the rolling spring of each contact [J], each of shape (c,).

    A rolling law of the user with a spring says with ``energy(angle, spring)`` what is in it, as ``rolling.spring`` does.
    """
    plan, none = view.model.features, np.zeros(len(contacts.i))
    law, at = plan.contact, plan.contact.coefficients
    normal = normal_energy(law.normal, contacts.overlap, contacts)
    out = {"normal": normal, "tangential": none, "rolling": none}
    if "spring" in law.history:
        k_n = normal_secant(law.normal, np.maximum(contacts.overlap, LEAST_OVERLAP), contacts)
        table = coefficients_of(view, contacts)
        out["tangential"] = 0.5 * table[:, at.shear] * k_n * np.einsum("ij,ij->i", contacts.spring, contacts.spring)
        bent = None
        if law.rolling is not None and "angle" in law.history:
            bent = getattr(model("rolling", law.rolling), "energy", None)
        if bent is not None:
            out["rolling"] = bent(contacts.angle, k_n * (table[:, at.rolling_friction] * contacts.radius) ** 2)
    return out


def normal_energy(normal: str, overlap: np.ndarray, contacts: Contacts) -> np.ndarray:
    """Energy of the normal law named ``normal`` in contacts if they had this ``overlap`` [m]; [J], shape (c,)."""
    if not contacts.own:  # linear in its one constant, which holds the weight already
        return elastic_energy(normal, overlap, contacts.stiffness)
    return contacts.weight * elastic_energy(normal, overlap, contacts.stiffness / contacts.weight, contacts.own)


def normal_secant(normal: str, overlap: np.ndarray, contacts: Contacts) -> np.ndarray:
    """k_n of the normal law named ``normal`` in contacts if they had this ``overlap`` [m]; [N/m], shape (c,)."""
    if not contacts.own:
        return secant(normal, overlap, contacts.stiffness)
    return contacts.weight * secant(normal, overlap, contacts.stiffness / contacts.weight, contacts.own)


def field_energies(
    run: Model, position: np.ndarray, position_lab: np.ndarray, mass: np.ndarray, radius: np.ndarray
) -> list[float]:
    """Potential energy of grains, positions (n, 3) [m], in each external field that has one [J]."""
    place = {"laboratory": position_lab, "frame": position}
    fields = [(model("field", name), place[axes]) for name, axes in run.features.fields]
    return [
        float(np.sum(field.energy(there, mass, radius, numbers)))
        for (field, there), numbers in zip(fields, field_numbers(run.scene), strict=True)
        if hasattr(field, "energy")
    ]


def coefficients_of(view: RunView, contacts: Contacts) -> np.ndarray:
    """Coefficients of each contact, columns as of ``ContactFeatures.coefficients``, shape (c, their number)."""
    run, state = view.model, view.state
    table = run.coefficient_table
    if not run.features.contact.table:
        return np.repeat(table[:1], len(contacts.i), axis=0)
    ids, kind = state.id.numpy()[state.rank], state.kind.numpy()[state.rank]
    first = kind[np.searchsorted(ids, contacts.i)]
    material = run.walls.material if run.walls is not None else np.zeros(0, dtype=int)
    other = np.where(
        contacts.j >= 0,
        kind[np.clip(np.searchsorted(ids, contacts.j), 0, len(ids) - 1)],
        np.append(material, 0)[np.clip(-1 - contacts.j, 0, len(material))],
    )
    return table[first * run.features.contact.materials + other]
