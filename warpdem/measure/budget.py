"""Budgets of energy and momentum in the laboratory: what there is, what came and went, and what does not close.

    E(t) = E(0) + W_walls + W_fields + C - D + error,      E = kinetic + rotational + elastic + potential + fields
    P(t) = P(0) + J_walls + J_gravity + J_fields + C + error,      L the same about the laboratory's origin

    W_walls    work of the walls' own motion, int sum (F . v_wall + M . w_wall) dt                    [J]
    W_fields   work of external fields without a potential, and of the axes that carry one with a potential  [J]
    C          what grains carry in and out: streams, outlets, borders, periodic images               [J]
    D          dissipated: normal and tangential damping, sliding, rolling, rescaling of springs      [J]
    J          impulse [N s] and angular impulse [N m s]
    error      what is left over: the error of the time integration                                  [J]

Where the frame turns, the integral of Jacobi, E - sum (m V . v_frame + I W . w_frame) [J], is what an observer in it takes for
the energy, -(1/2) m v_frame^2 being the potential of the centrifugal force: at a steady rate, and with gravity along the axis,
walls at rest in the frame do not change it.

The kernels add up D, W and J per grain at every step (``kernels.measure.budget``). In the laboratory the frame does no work:
the walls that it turns do. A grain that comes or leaves between two force calls counts with its velocity of mid-step and its
place there, at which the books of its work begin or end.
"""

import numpy as np

from warpdem.kernels import grain
from warpdem.kernels.measure.budget import ENERGIES, MOMENTA
from warpdem.measure import observers
from warpdem.state.view import RunView

STORED = ("kinetic", "rotational", "elastic", "potential", "fields")
DISSIPATED = ("normal_damping", "tangential_damping", "sliding", "rolling", "rescaling")
VECTORS = tuple(f"{kind}_{axis}" for kind in ("momentum", "angular_momentum") for axis in "xyz")


class Budget:
    """What was inserted, has left and was added up since the first step of a run.

    Args:
        view: the run; it has ``totals``, which this adds to and reads.
    """

    def __init__(self, view: RunView) -> None:
        if view.totals is None:
            raise ValueError("nothing is added up in this run: its scene has no measures of energy, momentum or flow")
        self._view, self._totals = view, view.totals

    def begin(self) -> None:
        """Note what there is at the first instant; later calls do nothing."""
        if not self._totals.start:
            self._totals.start = {"energy": [self._stored()], "momentum": self._momentum()}

    def energy(self) -> dict[str, float]:
        """Terms of the energy budget at the present time [J]."""
        self.begin()
        view, totals = self._view, self._totals
        elastic, all_sums = observers.elastic_energies(view, observers.read_contacts(view)), self._sums()
        sums, works = all_sums["energies"], all_sums["wall_work"]
        by_name = dict(zip(ENERGIES, sums, strict=True))
        out = {f"elastic_{kind}": float(values.sum()) for kind, values in elastic.items()}
        out |= {f"dissipated_{name}": by_name[name] for name in DISSIPATED}
        out |= {"work_walls": float(sum(works)), "work_fields": by_name["fields"]}
        out["carried_in"] = by_name["carried"] + totals.carried[0]
        given = out["work_walls"] + out["work_fields"] + out["carried_in"]
        lost = sum(by_name[name] for name in DISSIPATED)
        out["integration_error"] = self._stored() - totals.start["energy"][0] - given + lost
        out |= {"jacobi": self._jacobi()} if view.model.features.frame.moves else {}
        return out | {f"{wall.name} work": float(work) for wall, work in zip(view.model.scene.walls, works, strict=True)}

    def momentum(self) -> dict[str, float]:
        """Terms of the momentum budget [N s] and of the one of angular momentum [N m s], laboratory axes."""
        self.begin()
        now, sums = self._momentum(), self._sums()["momenta"]
        parts = {name: np.array(sums[6 * k : 6 * k + 6]) for k, name in enumerate(MOMENTA)}
        parts["carried"] = parts["carried"] + self._totals.carried[1:]
        error = now - np.array(self._totals.start["momentum"]) - sum(parts.values())
        terms: dict[str, list[float] | np.ndarray] = {"": now, **parts, "error": error}
        return {
            f"{vector} {name}".strip(): float(value)
            for name, six in terms.items()
            for vector, value in zip(VECTORS, six, strict=True)
        }

    def flow(self) -> list[float]:
        """Mass [kg] and number that have gone through each plane along its normal, one plane after the other."""
        return self._sums()["flow"]

    def inserted(self, slots: np.ndarray) -> None:
        """Count the grains in memory slots ``slots``, which have just been inserted."""
        self._carry(slots, 1.0)

    def left(self, slots: np.ndarray) -> None:
        """Count the grains in memory slots ``slots``, which are about to be removed, and keep what was added up of them."""
        if not self._totals.start:
            return
        view, totals = self._view, self._totals
        ids = view.state.id.numpy()[slots]
        slots, ids = slots[np.argsort(ids)], np.sort(ids)  # sums in order of id: memory has any order
        self._carry(slots, -1.0)
        if view.model.features.measures.energy:
            contacts = observers.read_contacts(view, since=1)
            theirs = np.isin(contacts.i, ids) | np.isin(contacts.j, ids)
            energies = observers.elastic_energies(view, contacts).values()
            totals.carried[0] -= sum(float(energy[theirs].sum()) for energy in energies)
        for name, sums in totals.gone.items():
            theirs = getattr(view.state, name).numpy()[slots].sum(axis=0)
            sums[:] = np.add(sums, self._laboratory(name, theirs)).tolist()

    def _stored(self) -> float:
        energy = observers.energy(self._view)
        return sum(energy.get(name, 0.0) for name in STORED)

    def _jacobi(self) -> float:
        """Energy less what goes with the frame: E - sum (m V . v_frame + I W . w_frame) [J]."""
        view, p = self._view, observers.Particles(self._view)
        pose = view.model.schedule.pose(view.clock.time)
        _, _, velocity, spin = view.readings()
        along = p.mass @ np.einsum("ij,ij->i", velocity, pose.velocity_at(p.position)) + p.inertia @ (spin @ pose.spin)
        return self._stored() - float(along)

    def _momentum(self) -> list[float]:
        p = observers.Particles(self._view)
        velocity, mass = p.velocity_lab, p.mass
        spin = p.inertia @ p.spin_lab
        return [*(mass @ velocity), *(mass @ np.cross(p.position_lab, velocity) + spin)]

    def _carry(self, slots: np.ndarray, sign: float) -> None:
        """Add what grains bring at mid-step, before the force call of the present instant."""
        if not self._totals.start:  # what is there at the first instant is part of the start
            return
        model, state, clock = self._view.model, self._view.state, self._view.clock
        record, inverse = state.record.numpy()[slots], state.inverse.numpy()[slots]
        mass, inertia = 1.0 / inverse[:, 0], 1.0 / inverse[:, 1]
        pose = model.schedule.pose(clock.time)
        velocity = record[:, grain.VELOCITY]
        spin = record[:, grain.SPIN] if model.features.contact.spins else np.zeros_like(velocity)
        place = record[:, grain.POSITION] - 0.5 * clock.dt * velocity
        there = pose.to_laboratory(place)
        fields = observers.field_energies(model, place, there, mass, record[:, grain.RADIUS])
        moving = 0.5 * (mass @ np.einsum("ij,ij->i", velocity, velocity) + inertia @ np.einsum("ij,ij->i", spin, spin))
        velocity, spin = velocity @ pose.rotation.T, spin @ pose.rotation.T
        energy = moving - mass @ (there @ np.array(model.scene.gravity)) + sum(fields)
        all_seven = [energy, *(mass @ velocity), *(mass @ np.cross(there, velocity) + inertia @ spin)]
        carried = self._totals.carried
        self._totals.carried = [float(have + sign * new) for have, new in zip(carried, all_seven, strict=True)]

    def _sums(self) -> dict[str, list[float]]:
        """What has been added up of all grains, those that left too; vectors in laboratory axes."""
        per_grain, rank = self._view.reader.read_sums(), self._view.state.rank
        return {
            name: np.add(gone, self._laboratory(name, per_grain[name][rank].sum(axis=0))).tolist()
            for name, gone in self._totals.gone.items()
        }

    def _laboratory(self, name: str, sums: np.ndarray) -> np.ndarray:
        """Vectors rotated from frame axes to the laboratory."""
        if name != "momenta":
            return sums
        pose = self._view.model.schedule.pose(self._view.clock.time)
        return (sums.reshape(-1, 3) @ pose.rotation.T).ravel()
