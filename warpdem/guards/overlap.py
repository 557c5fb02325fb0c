"""An overlap that no sound run reaches: more than engine.max_overlap of the radius."""

from warpdem.guards.verdict import Verdict, at_time
from warpdem.measure.observers import read_contacts
from warpdem.model.model import Model
from warpdem.state.view import RunView


class OverlapGuard:
    """Compares the largest overlap met so far with what the scene allows."""

    NAME = "overlap"

    def __init__(self, model: Model) -> None:
        self._allowed = model.scene.engine.max_overlap

    def is_exceeded(self, met: dict[str, float]) -> bool:
        """Whether an overlap was met that is larger than allowed; ``met`` as ``RunView.extremes``."""
        return _largest(met) > self._allowed

    def look(self, view: RunView, met: dict[str, float], excess: str) -> Verdict:
        """The verdict on an overlap that is larger than allowed; the deepest contact now is named.

        Args:
            view: the run, its forces evaluated.
            met: ``view.extremes`` when the overlap was met.
            excess: by how much the time step exceeded the stability limit, as text; empty if it did not.
        """
        clock, limits = view.clock, view.model.limits
        contacts = read_contacts(view)
        kind = "grains" if met["pair_overlap_share"] >= met["wall_overlap_share"] else "a grain and a wall"
        where = contacts.worst() if len(contacts.i) else "The contact is over by now."
        fastest = max(met["pair_approach_speed"], met["wall_approach_speed"])
        deepest = float(contacts.overlap.max(initial=0.0))
        remedy = "Take a smaller time.step, or a stiffer material."
        if deepest > 0.0 and fastest * max(clock.time, clock.dt) < 0.5 * deepest:
            remedy = "Nothing moved as far as that: it was so when the grain was placed. Give it, or its wall, another place."
        return Verdict(
            self.NAME,
            f"{at_time(clock)}: {kind} overlap by {_largest(met):.3g} of the radius, "
            f"allowed is engine.max_overlap = {self._allowed:g}. {where} Time step {clock.dt:.3g} s, "
            f"{excess + '; ' if excess else ''}stability limit of an impact "
            f"{limits.stable:.3g} s at {limits.max_speed:.3g} m/s; largest approach speed met "
            f"{fastest:.3g} m/s. {remedy}",
        )


def _largest(met: dict[str, float]) -> float:
    """Largest overlap over radius [-]."""
    return max(met["pair_overlap_share"], met["wall_overlap_share"])
