"""Budgets of energy and momentum in the laboratory: what there is, what came and went, and what does not close.

    E(t) = E(0) + W_walls + W_fields + C - D + error,      E = kinetic + rotational + elastic + potential + fields
    P(t) = P(0) + J_walls + J_gravity + J_fields + C + error,      L the same about the laboratory's origin

    W_walls    work of the walls' own motion, int sum (F . v_wall + M . w_wall) dt                    [J]
    W_fields   work of external fields without a potential, and of the axes that carry one with a potential  [J]
    C          what grains carry in and out: streams, outlets, borders, periodic images               [J]
    D          dissipated: normal and tangential damping, sliding, rolling, rescaling of springs, and what the normal law
               declares as its LOSSES: adhesion, plasticity, liquid                                   [J]
    J          impulse [N s] and angular impulse [N m s]
    error      what is left over: the error of the time integration                                  [J]

Where the frame turns, the integral of Jacobi, E - sum (m V . v_frame + I W . w_frame) [J], is what an observer in it takes for
the energy, -(1/2) m v_frame^2 being the potential of the centrifugal force: at a steady rate, and with gravity along the axis,
walls at rest in the frame do not change it.

The kernels add up D, W and J at every step (``kernels.measure.budget``), what contacts between grains lose in sums of the whole
run and all else per grain. In the laboratory the frame does no work:
the walls that it turns do. A grain that comes or leaves between two force calls counts with its velocity of mid-step and its
place there, at which the books of its work begin or end.
"""

import numpy as np

from warpdem.core.pose import FramePose
from warpdem.kernels import grain
from warpdem.kernels.clump import NONE
from warpdem.kernels.measure.budget import ENERGIES, MOMENTA
from warpdem.measure import observers
from warpdem.measure.contact_columns import ContactColumns
from warpdem.measure.elastic import elastic_energies
from warpdem.measure.selection import Slots, selected_flow
from warpdem.measure.sums import reader_of
from warpdem.measure.totals import Totals
from warpdem.state.particles import State
from warpdem.state.view import RunView

STORED = ("kinetic", "rotational", "elastic", "potential", "fields")
VECTORS = tuple(f"{kind}_{axis}" for kind in ("momentum", "angular_momentum") for axis in "xyz")


class Budget:
    """What was inserted, has left and was added up since the first step of a run.

    Args:
        view: the run; it has ``totals``, which this adds to and reads.
        now: sums over its grains at the present time, where a reader has them already.
    """

    def __init__(self, view: RunView, now: Totals | None = None) -> None:
        if view.totals is None:
            raise ValueError("nothing is added up in this run: its scene has no measures of energy, momentum or flow")
        self._view, self._totals, self._given = view, view.totals, now

    def begin(self) -> None:
        """Note what there is at the start; later calls do nothing."""
        if not self._totals.start:
            now = self._now()
            self._totals.start = {"energy": [_stored(now)], "momentum": now.momentum.tolist()}

    def energy(self) -> dict[str, float]:
        """Terms of the energy budget at the present time [J]."""
        self.begin()
        view, totals, now = self._view, self._totals, self._now()
        all_sums = self._sums(now)
        sums, works = all_sums["energies"], all_sums["wall_work"]
        for one in view.model.schedule.dynamic:  # the steps have counted the velocities that the contacts saw
            works[one.number] += one.value("correction")
        measures = view.model.features.measures
        by_name, dissipated = dict(zip((*ENERGIES, *measures.losses), sums, strict=True)), measures.of_contacts
        for name, lost in zip(dissipated, now.losses.tolist(), strict=True):
            by_name[name] += lost
        out = {f"elastic_{kind}": energy for kind, energy in now.elastic.items()}
        out |= {f"dissipated_{name}": by_name[name] for name in dissipated}
        out |= {"work_walls": float(sum(works)), "work_fields": by_name["fields"]}
        out["carried_in"] = by_name["carried"] + totals.carried[0]
        given = out["work_walls"] + out["work_fields"] + out["carried_in"]
        lost = sum(by_name[name] for name in dissipated)
        out["integration_error"] = _stored(now) - totals.start["energy"][0] - given + lost
        out |= {"jacobi": _stored(now) - now.along_frame} if view.model.features.frame.moves else {}
        return out | {f"{wall.name} work": float(work) for wall, work in zip(view.model.scene.walls, works, strict=True)}

    def momentum(self) -> dict[str, float]:
        """Terms of the momentum budget [N s] and of the one of angular momentum [N m s], laboratory axes."""
        self.begin()
        totals = self._now()
        now, sums = totals.momentum, self._sums(totals)["momenta"]
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
        return self._sums(self._now())["flow"]

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
            reader = reader_of(view)
            contacts = ContactColumns(view, reader, since=1)
            theirs = np.isin(contacts.i, ids) | np.isin(contacts.j, ids)
            energies = [values[theirs] for values in elastic_energies(view, contacts).values() if values is not None]
            totals.carried[0] -= sum(float(energy[0]) for energy in reader.column_sums(*energies))
        for name, sums in totals.gone.items():
            of_each = getattr(view.state, name).numpy()[slots]
            if name == "flow":
                of_each = selected_flow(view.model.scene, Slots(view.state, slots), of_each)
            theirs = of_each.sum(axis=0)
            sums[:] = np.add(sums, _laboratory(name, theirs, view.model.schedule.pose(view.clock.time))).tolist()

    def _now(self) -> Totals:
        """Sums over the grains at the present time: those given, or new ones, since a run goes on."""
        return self._given or Totals(self._view)

    def _carry(self, slots: np.ndarray, sign: float) -> None:
        """Add what grains bring at mid-step, before the force call of the present time."""
        if not self._totals.start:  # what is there at first is part of the start
            return
        model, state, clock = self._view.model, self._view.state, self._view.clock
        record, mass, spin, angular = _moving(state, slots)
        pose = model.schedule.pose(clock.time)
        velocity = record[:, grain.VELOCITY]
        place = record[:, grain.POSITION] - 0.5 * clock.dt * velocity
        there = pose.to_laboratory(place)
        fields = observers.field_energies(model, place, there, mass, record[:, grain.RADIUS])
        moving = 0.5 * (mass @ np.einsum("ij,ij->i", velocity, velocity) + np.einsum("ij,ij->", angular, spin))
        velocity, angular = velocity @ pose.rotation.T, angular @ pose.rotation.T
        energy = moving - mass @ (there @ np.array(model.scene.gravity)) + sum(fields)
        all_seven = [energy, *(mass @ velocity), *(mass @ np.cross(there, velocity) + angular.sum(axis=0))]
        carried = self._totals.carried
        self._totals.carried = [float(have + sign * new) for have, new in zip(carried, all_seven, strict=True)]

    def _sums(self, now: Totals) -> dict[str, list[float]]:
        """What has been added up of all grains, those that left too; vectors in laboratory axes."""
        added_up = now.added_up
        return {
            name: np.add(gone, _laboratory(name, added_up[name], now.pose)).tolist()
            for name, gone in self._totals.gone.items()
        }


def _moving(state: State, slots: np.ndarray) -> tuple[np.ndarray, ...]:
    """Record, mass [kg], spin [rad/s] and angular momentum [N m s] of grains; of clumps, whose members they may be, as a whole.

    Args:
        state: the grains.
        slots: their memory slots, all members of a clump or none.
    """
    record, inverse = state.record.numpy()[slots], state.inverse.numpy()[slots]
    mass, inertia = 1.0 / inverse[:, 0], 1.0 / inverse[:, 1]
    spin = record[:, grain.SPIN] if state.spins else np.zeros((len(slots), 3))
    angular = inertia[:, None] * spin
    if state.clumps is None:
        return record, mass, spin, angular
    of = state.clumps.of_grain.numpy()[slots]
    alone, clumps = of == NONE, np.unique(of[of != NONE])
    own, whole = (record, mass, spin, angular), state.clumps.moving(clumps)
    return tuple(np.concatenate([one[alone], other]) for one, other in zip(own, whole, strict=True))


def _stored(now: Totals) -> float:
    """Energy that there is [J]."""
    return sum(now.energy.get(name, 0.0) for name in STORED)


def _laboratory(name: str, sums: np.ndarray, pose: FramePose) -> np.ndarray:
    """Vectors rotated from frame axes to the laboratory."""
    return (sums.reshape(-1, 3) @ pose.rotation.T).ravel() if name == "momenta" else sums
