"""Read-only measures of a run: grains, contacts, energies."""

from dataclasses import dataclass, fields

import numpy as np

from warpdem.errors import SceneError
from warpdem.kernels import grain
from warpdem.kernels.contact.films import FILM_AT
from warpdem.measure.contact_columns import ContactColumns
from warpdem.measure.sums import reader_of
from warpdem.measure.totals import Totals
from warpdem.model.coefficients import field_numbers
from warpdem.model.model import Model
from warpdem.scene.models import model
from warpdem.state.particles import unrotated
from warpdem.state.view import RunView


class Particles:
    """The grains of a run at one time t_k, ordered by id; NumPy arrays are fresh copies.

    Velocities are those of t_k as the integrator completes its step: for exact_drift V_k = V + (dt/2) a_k.
    """

    def __init__(self, view: RunView) -> None:
        self._view = view
        self._state = view.state
        self._pose = view.model.schedule.pose(view.clock.time)
        self._read_at = -1

    def __repr__(self) -> str:
        return f"<Particles: {len(self._state)} grains at t = {self._view.clock.time:.6g} s>"

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
        return self._state.material.numpy()[self._state.rank]

    @property
    def group(self) -> np.ndarray:
        """Number of the group, of those of ``Scene.groups``, shape (n,), int32."""
        return self._state.group[self._state.rank]

    @property
    def orientation(self) -> np.ndarray:
        """Unit quaternions (w, x, y, z) from body axes to frame axes, shape (n, 4); body axes are frame axes at the start.

        All grains keep their orientation while nothing rotates them.

        Raises:
            SceneError: the scene does not ask for it with output.orientation = true.
        """
        scene = self._view.model.scene
        if not scene.output.orientation:
            raise SceneError(f"{scene.source}: output.orientation = false: how grains turn is not kept")
        if self._state.orientation is None:
            return unrotated(len(self._state))
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
    def liquid(self) -> np.ndarray:
        """Liquid on each grain, without that in bridges [m3], shape (n,).

        Raises:
            SceneError: the scene has no law of liquid bridges.
        """
        liquid, film = self._view.model.liquid, self._state.film
        if liquid is None or film is None:
            raise SceneError(f'{self._view.model.scene.source}: contact.liquid = "none": there is no liquid')
        counts = film.numpy()[self._state.rank]
        return (counts[:, FILM_AT.film] + counts[:, FILM_AT.returned]) * liquid.quantum

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
        """Angular velocity of the frame and velocity of its origin just before this time, in frame axes."""
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
    bridge: np.ndarray
    """Liquid in the bridge, 0 without one [m3], shape (c,)."""
    own: dict[str, np.ndarray]
    """The normal law's own constants and history by name [of the law], each of shape (c,)."""

    def __repr__(self) -> str:
        walls = int((self.j < 0).sum())
        deepest = f"; {self.worst()}" if len(self.i) else ""
        return f"<Contacts: {len(self.i) - walls} of two grains, {walls} with walls{deepest}>"

    def only(self, which: np.ndarray) -> "Contacts":
        """The contacts ``which``, shape (c,), boolean."""
        parts = {f.name: getattr(self, f.name)[which] for f in fields(self) if f.name != "own"}
        return Contacts(**parts, own={name: values[which] for name, values in self.own.items()})

    def worst(self) -> str:
        """The deepest contact in words."""
        c = int(np.argmax(self.share))
        partner = f"grain {self.j[c]}" if self.j[c] >= 0 else f"wall {-1 - self.j[c]}"
        place = ", ".join(f"{x:.4g}" for x in self.point[c])
        return f"Deepest now: grain {self.i[c]} with {partner} at ({place}) m, {self.share[c]:.3g} of the radius."


def read_contacts(view: RunView, since: int = 0) -> Contacts:
    """Contacts of a run at the time of the view, from the results of its last force call, ``since`` steps ago."""
    found = ContactColumns(view, reader_of(view), since)
    # stable: the places of a grain on a wall keep theirs
    order = np.lexsort((found.j, found.i, np.arange(len(found)) >= found.pairs))
    names = [f.name for f in fields(Contacts) if f.name != "own"]
    own = {name: values[order] for name, values in found.own.items()}
    return Contacts(**{name: getattr(found, name)[order] for name in names}, own=own)


def energy(view: RunView) -> dict[str, float]:
    """Energies in the laboratory [J].

    kinetic (1/2) m V^2, rotational (1/2) I W^2, elastic of the normal contacts, of the tangential springs (1/2) k_t s^2 and
    of the rolling springs, potential -m g . x; and, where the scene has external fields with a potential, theirs at the
    present positions.
    """
    return Totals(view).energy


def field_energies(
    run: Model, position: np.ndarray, position_lab: np.ndarray, mass: np.ndarray, radius: np.ndarray
) -> list[float]:
    """Potential energy of grains, positions (n, 3) [m], in each external field that has one [J]."""
    place = {"laboratory": position_lab, "frame": position}
    fields = [(model("field", name), place[axes]) for name, axes in run.features.fields]
    return [
        float(np.sum(np.broadcast_to(field.energy(there, mass, radius, numbers), mass.shape)))
        for (field, there), numbers in zip(fields, field_numbers(run.scene), strict=True)
        if hasattr(field, "energy")
    ]


def coefficients_of(view: RunView, contacts: Contacts) -> np.ndarray:
    """Coefficients of each contact, columns as of ``ContactFeatures.coefficients``, shape (c, their number)."""
    run, state = view.model, view.state
    table = run.coefficient_table
    if not run.features.contact.table:
        return np.broadcast_to(table[:1], (len(contacts.i), table.shape[1]))
    ids, kind = state.id.numpy()[state.rank], state.material.numpy()[state.rank]
    first = kind[np.searchsorted(ids, contacts.i)]
    material = run.walls.material if run.walls is not None else np.zeros(0, dtype=int)
    other = np.where(
        contacts.j >= 0,
        kind[np.clip(np.searchsorted(ids, contacts.j), 0, len(ids) - 1)],
        np.append(material, 0)[np.clip(-1 - contacts.j, 0, len(material))],
    )
    return table[first * run.features.contact.materials + other]
