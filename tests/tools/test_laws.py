"""The benchmark of normal laws on a tiny bed made here."""

import pytest

from bench import laws, states
from warpdem.scene.models import model_names


def test_laws_that_need_keys_have_them():
    with_keys = {"jkr", "jkr_fixed_load", "dmt", "sjkr", "luding", "edinburgh"}
    assert with_keys <= set(model_names("normal"))
    assert set(laws.KEYS) == with_keys | set(model_names("liquid"))


@pytest.mark.slow
def test_every_law_is_timed_on_one_bed(tmp_path):
    settings = states.Settings("mindlin", warm=1, steps=2, repeats=2)
    every = *model_names("normal"), *model_names("liquid")
    report = laws.bench(every, "full", 200, settings, settle=20, work=tmp_path, launches=2)
    rows = {row["law"]: row for row in report["laws"]}
    assert sorted(rows) == sorted(every)
    assert all(rows[law]["acting_per_grain"] >= rows[law]["contacts_per_grain"] for law in every)
    assert rows["hertz"]["over_hertz"] == rows["hertz"]["pairs_over_hertz"] == 1.0
    assert all(row["contacts_per_grain"] > 0.0 and row["pairs_ns"] > 0.0 for row in rows.values())
