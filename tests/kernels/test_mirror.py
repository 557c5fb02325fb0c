from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
ROLES = ("normal", "tangential", "rolling", "twisting", "liquid", "field", "observer")
MODELS = sorted(p for role in ROLES for p in (ROOT / "kernels" / role).glob("[!_]*.py"))


def test_there_are_models_of_every_role():
    assert {p.parent.name for p in MODELS} == set(ROLES)


@pytest.mark.parametrize("model", MODELS, ids=lambda p: f"{p.parent.name}.{p.stem}")
def test_every_model_file_has_its_test_file(model):
    mirror = ROOT / "tests" / "kernels" / model.parent.name / f"test_{model.name}"
    assert mirror.is_file(), f"{model.relative_to(ROOT)} needs {mirror.relative_to(ROOT)}"
