"""The short form of the stress table: every hard scene does what the table says beforehand."""

import json

import pytest

from stress import table


def name_of(case) -> str:
    return f"{case.scene}: {case.invariant}"


@pytest.mark.parametrize("case", table.chosen("short", []), ids=name_of)
def test_hard_scene(case):
    row = table.run(case)
    assert row["good"], row


@pytest.mark.slow
@pytest.mark.parametrize("case", [c for c in table.CASES if c.tier != "short"], ids=name_of)
def test_longer_hard_scene(case):
    test_hard_scene(case)


def test_few_may_fail_and_each_with_its_reason():
    failing = [case for case in table.CASES if case.expected != "held"]
    assert len(failing) <= 10
    assert all(case.reason for case in failing)
    assert len([case for case in table.CASES if case.tier != "full"]) >= 40


def test_scenes_have_names_of_their_own():
    names = [(case.scene, case.invariant) for case in table.CASES]
    assert len(set(names)) == len(names)


def test_a_scene_that_does_otherwise_is_told():
    """Over its limit, nothing measured, stopped or refused unasked."""
    from stress.cases import Case
    from warpdem import SceneError, StabilityError

    def refuse() -> float:
        raise SceneError("no")

    def stop() -> float:
        raise StabilityError("why")

    cases = [
        (Case("a", "i", lambda: 0.5, 1.0), "held", True),
        (Case("b", "i", lambda: 1.5, 1.0), "broken", False),
        (Case("c", "i", lambda: float("nan"), 1.0), "broken", False),
        (Case("d", "i", stop, 1.0), "stopped", False),
        (Case("e", "i", stop, expected="stopped", reason="too hard"), "stopped", True),
        (Case("f", "i", refuse, expected="stopped", reason="too hard"), "refused", False),
        (Case("g", "i", lambda: 0.0, expected="refused", reason="too hard"), "broken", False),
    ]
    rows = [table.run(case) for case, _, _ in cases]
    assert [(row["verdict"], row["good"]) for row in rows] == [(verdict, good) for _, verdict, good in cases]
    json.dumps(rows, allow_nan=False)
    written = table.table(rows)
    assert "7 scenes, 1 held, 2 as expected." in written
    assert "* d: i, limit 1: stopped (**expected: held**; why)" in written
    assert "* e: to be i: stopped: too hard" in written


def test_results_in_the_repository_are_whole():
    found = json.loads((table.RESULTS / "stress.json").read_text())
    assert all(row["good"] for row in found["rows"])
    ran = {(row["scene"], row["invariant"]) for row in found["rows"]}
    assert ran >= {(case.scene, case.invariant) for case in table.CASES if case.tier != "full"}
