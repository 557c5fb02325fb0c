"""How guards tell where and when."""

from warpdem.kernels import grain


def instant(sim) -> str:
    """The present time in words."""
    return f"at t = {sim.time:.6g} s (step {sim.step_number})"


def grain_at(sim, row: int) -> str:
    """Grain number ``row`` in order of id, with its place, in words."""
    where = ", ".join(f"{x:.4g}" for x in sim.state.by_id(grain.POSITION)[row])
    return f"grain {int(sim.state.ids[row])} at ({where}) m"
