"""What the runs say: the answers of each setting, whether they are the same answer, and what they cost."""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations
from typing import Any

import numpy as np

from bench.answer.cases import Case, Rows

REFERENCE = "paper"
"""Setting whose answer the others are held against, if it was run."""
SAME = 3.0
"""Standard errors that two means of the same answer may lie apart [-]."""


@dataclass(frozen=True)
class Done:
    """One finished run.

    Attributes:
        case: Name of the case.
        setting: Name of the time step, which tells the code too.
        threads: CPU threads or processes.
        twin: Number of the nudge of its start.
        record: What the JSON file holds of it.
    """

    case: str
    setting: str
    threads: int
    twin: int
    record: dict[str, Any]

    @property
    def rows(self) -> Rows:
        """What it read."""
        return Rows(*np.array(self.record["rows"]))


def curves(case: Case, runs: Sequence[Done], time: np.ndarray) -> np.ndarray:
    """Curves of runs at ``time`` [s], shape (runs, k)."""
    return np.array([np.interp(time, run.rows.time, case.curve(run.rows)) for run in runs])


def twin_scatter(groups: Sequence[np.ndarray]) -> float:
    """Standard deviation of single numbers about the mean of their group, all groups together; nan without twins."""
    freedom = sum(len(group) - 1 for group in groups)
    if freedom < 1:
        return float("nan")
    return float(np.sqrt(sum(((group - group.mean()) ** 2).sum() for group in groups) / freedom))


def compared(case: Case, runs: Sequence[Done]) -> dict[str, Any]:
    """Answers of each setting, and their distances from the reference over the scatter of twins.

    A setting has one answer per run, whatever the threads: means are compared, and the scatter is that of single runs about
    the mean of their setting, taken from all settings, for two twins alone say little. Two answers are the same where their
    means lie within `SAME` standard errors. For the curve the largest distance of the mean curves stands beside the largest
    distance of any two twins.

    Returns:
        ``answers``: by setting and name mean, standard_error and difference_in_standard_errors; ``curves``: by setting the
        largest difference of the means; ``twins``: the largest one between twins; ``same``: by setting, None where there are
        no twins to tell by.
    """
    settings = list(dict.fromkeys(run.setting for run in runs))
    grouped = {s: [run for run in runs if run.setting == s] for s in settings}
    reference = REFERENCE if REFERENCE in grouped else settings[0]
    found = {s: [case.answers(case, run.rows) for run in group] for s, group in grouped.items()}
    names = list(found[reference][0])
    answers: dict[str, dict[str, dict[str, float]]] = {s: {} for s in settings}
    for name in names:
        values = {s: np.array([one[name] for one in found[s]]) for s in settings}
        scatter = twin_scatter(list(values.values()))
        for s in settings:
            error = scatter / np.sqrt(len(values[s]))
            apart = np.hypot(error, scatter / np.sqrt(len(values[reference])))
            distance = values[s].mean() - values[reference].mean()
            answers[s][name] = {
                "mean": float(values[s].mean()),
                "standard_error": float(error),
                "difference_in_standard_errors": 0.0 if s == reference else float(distance / apart),
            }
    time = np.linspace(0.0, min(run.rows.time[-1] for run in runs), 301)
    lines = {s: curves(case, group, time) for s, group in grouped.items()}
    pairs = [np.abs(a - b).max() for group in lines.values() for a, b in combinations(group, 2)]
    off = {s: float(np.abs(line.mean(axis=0) - lines[reference].mean(axis=0)).max()) for s, line in lines.items()}
    return {
        "reference": reference,
        "answers": answers,
        "curves": off,
        "twins": float(max(pairs, default=np.nan)),
        "same": {s: _same(answers[s]) for s in settings},
    }


def _same(answers: dict[str, dict[str, float]]) -> bool | None:
    """Whether all answers of a setting are those of the reference; None where nothing tells."""
    apart = [abs(one["difference_in_standard_errors"]) for one in answers.values()]
    if any(np.isnan(one["mean"]) for one in answers.values()) or np.isnan(apart).any():
        return None
    return max(apart) <= SAME


def costs(runs: Sequence[Done], own: str = "auto") -> list[dict[str, Any]]:
    """A row per case, setting and threads: time step, steps, seconds, and the seconds over those of warpdem's own step.

    Seconds are the least of the twins: what else runs on a machine only adds.
    """
    found: dict[tuple[str, str, int], list[Done]] = {}
    for run in runs:
        found.setdefault((run.case, run.setting, run.threads), []).append(run)
    rows = []
    for (case, setting, threads), group in sorted(found.items(), key=lambda item: (item[0][0], item[0][2])):
        least = {key: min(run.record[key] for run in group) for key in ("wall", "processor", "loop")}
        ours = found.get((case, own, threads))
        ratio = None if ours is None else least["wall"] / min(run.record["wall"] for run in ours)
        first = group[0].record
        rows.append(
            {"case": case, "setting": setting, "threads": threads, "runs": len(group), "step": first["step"],
             "steps": first["steps"], **least, "over_own": ratio, "load": max(run.record["load"] for run in group)}
        )  # fmt: skip
    return rows
