"""What the measured settings of one problem say: cost at equal error, the efficient frontier, where each scheme wins."""

import math
from collections.abc import Iterable, Sequence
from itertools import groupby

DEFAULT = ("exact_drift", "double")
ROUND_OFF = 1e-12  # [-] below this at every step a scheme counts as exact
TARGETS = tuple(10.0 ** (-0.5 * k) for k in range(2, 21))


def cost_key(settings: Sequence[dict]) -> str:
    """Seconds where they were measured, else force calls."""
    return "seconds" if all(s["seconds"] is not None for s in settings) else "force_calls"


def curves(settings: Iterable[dict]) -> dict[tuple[str, str], list[dict]]:
    """Settings by (integrator, precision), each by rising number of steps."""
    ordered = sorted(settings, key=lambda s: (s["integrator"], s["precision"], s["steps"]))
    return {key: list(group) for key, group in groupby(ordered, key=lambda s: (s["integrator"], s["precision"]))}


def cost_at(curve: Sequence[dict], target: float, key: str) -> float | None:
    """Cost from which on a scheme's error stays within ``target``, log-log between its settings; None if it never does.

    Lucky zeros do not count: it is the last crossing that matters. A run that broke down (error None) is over any target.
    """
    over = [k for k, s in enumerate(curve) if s["error"] is None or s["error"] > target]
    if not over:
        return curve[0][key]
    if over[-1] == len(curve) - 1:
        return None
    before, after = curve[over[-1]], curve[over[-1] + 1]
    if before["error"] is None or after["error"] == 0.0:
        return after[key]
    share = math.log(before["error"] / target) / math.log(before["error"] / after["error"])
    return before[key] * (after[key] / before[key]) ** share


def frontier(settings: Sequence[dict], key: str) -> list[dict]:
    """Settings that no other beats in both cost and error, by rising cost."""
    best, kept = math.inf, []
    for s in sorted((s for s in settings if s["error"] is not None), key=lambda s: (s[key], s["error"])):
        if s["error"] < best:
            best = s["error"]
            kept.append(s)
    return kept


def cheapest(settings: Sequence[dict], key: str) -> list[dict]:
    """For each error that some scheme reaches: the cheapest scheme, its cost, and that of the default scheme."""
    by_scheme, rows = curves(settings), []
    for target in TARGETS:
        costs = {scheme: c for scheme, curve in by_scheme.items() if (c := cost_at(curve, target, key)) is not None}
        if costs:
            best = min(costs, key=costs.__getitem__)
            rows.append({"error": target, "integrator": best[0], "precision": best[1], key: costs[best],
                         "default": costs.get(DEFAULT)})  # fmt: skip
    return rows


def others_win(rows: Sequence[dict]) -> list[str]:
    """The rows of ``cheapest`` at which another integrator than the default one wins, in words."""
    key = next((k for k in ("seconds", "force_calls") if rows and k in rows[0]), "")
    found = []
    for row in rows:
        if row["integrator"] != DEFAULT[0]:
            more = "does not reach it" if row["default"] is None else f"costs {row['default'] / row[key]:.2f} times as much"
            found.append(f"error {row['error']:.0e}: {row['integrator']} ({row['precision']}) wins, {DEFAULT[0]} {more}")
    return found


def against_one_call(settings: Sequence[dict], key: str) -> list[dict]:
    """At each error that both reach: cost of the default scheme over that of the best other scheme of one force call."""
    rivals = {
        scheme: curve for scheme, curve in curves(settings).items()
        if scheme[0] != DEFAULT[0] and scheme[1] == DEFAULT[1] and curve[0]["calls_per_step"] == 1
    }  # fmt: skip
    own, rows = curves(settings).get(DEFAULT, []), []
    for target in TARGETS:
        costs = {scheme[0]: c for scheme, curve in rivals.items() if (c := cost_at(curve, target, key)) is not None}
        mine = cost_at(own, target, key) if own else None
        if costs and mine is not None:
            best = min(costs, key=costs.__getitem__)
            rows.append({"error": target, "rival": best, "ratio": mine / costs[best]})
    return rows


def claims(problem: str, settings: Sequence[dict], key: str) -> list[dict]:
    """What is claimed of the default scheme on ``problem``, with what was measured and whether it holds."""
    rows = against_one_call(settings, key)
    if problem == "damped_contact" and rows:
        worst = max(rows, key=lambda row: row["ratio"])
        text = "exact_drift is at most 10 % dearer than any other one-call scheme at equal error"
        return [{"claim": text, "worst": worst, "holds": worst["ratio"] <= 1.1}]
    if problem != "free_grain":
        return []
    single = {s[0]: c for s, c in curves(settings).items() if s[1] == DEFAULT[1] and c[0]["calls_per_step"] == 1}
    exact = [
        name for name, curve in single.items() if all(s["error"] is not None and s["error"] < ROUND_OFF for s in curve)
    ]
    mine = cost_at(single[DEFAULT[0]], 1e-4, key) if DEFAULT[0] in single else None
    reached = {
        s[0]: c for s, curve in curves(settings).items()
        if s[0] != DEFAULT[0] and (c := cost_at(curve, 1e-4, key)) is not None
    }  # fmt: skip
    rival = min(reached, key=reached.__getitem__, default=None)
    ratio = reached[rival] / mine if rival is not None and mine is not None else None
    return [
        {"claim": "exact_drift is the only one-call scheme exact here", "exact": exact, "holds": exact == [DEFAULT[0]]},
        {"claim": "exact_drift is at least 10 times cheaper at error 1e-4 than any other scheme", "rival": rival,
         "ratio": ratio, "holds": mine is not None and (ratio is None or ratio >= 10.0)},
    ]  # fmt: skip
