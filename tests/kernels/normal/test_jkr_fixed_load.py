import math
from types import SimpleNamespace

import numpy as np
import pytest
import warp as wp
from warpdem.kernels.normal import jkr, jkr_fixed_load

from adhesion import ENERGY, POISSON, YOUNG, contacts

UNIT = {"stiffness": 1.0 / math.sqrt(3.0), "pull_off": 1.0}  # F_c = d_c = 1
END = -0.480749856769136


def test_it_is_jkr_down_to_the_largest_pull_and_nothing_beyond(real):
    ratio = np.array([5.0, 0.3, -0.2, -0.48])
    both = [contacts(law, real, ratio, ratio, 0.5, **UNIT) for law in (jkr, jkr_fixed_load)]
    for name in both[0]:
        assert (both[0][name] == both[1][name]).all(), name
    ended = contacts(jkr_fixed_load, real, [-0.49, -0.6, -3.1], [-0.4, -0.55, -0.4], [0.5, 0.0, 0.5], **UNIT)
    assert ended["history"].tolist() == [0.0, 0.0, 0.0]
    # -F_c in the step of the end, for what is left of it
    share = 0.5 - (0.49 + END) / 0.09
    assert ended["force"] == pytest.approx([-share, 0.0, 0.0], rel=1e-5 if real is wp.float32 else 1e-12)


def test_it_loses_half_of_the_theory_s_energy(real):
    touch = contacts(jkr_fixed_load, real, 1e-3, -1e-3, 0.0, **UNIT)
    assert touch["adhesion"][0] == pytest.approx(0.462014008967731, rel=1e-14 if real is wp.float64 else 1e-6)
    assert jkr_fixed_load.TEARS == pytest.approx(END, rel=1e-14)
    assert jkr_fixed_load.energy(END, UNIT["stiffness"], 1.0, 0.5) == pytest.approx(0.0, abs=1e-15)
    assert jkr_fixed_load.energy(1e-12, UNIT["stiffness"], 1.0, 0.5) == pytest.approx(-0.462014008967731, rel=1e-11)


def test_its_contacts_have_the_constants_of_jkr():
    soft = SimpleNamespace(young_modulus=YOUNG, poisson_ratio=POISSON)
    pair = SimpleNamespace(surface_energy=ENERGY, restitution=0.9)
    assert jkr_fixed_load.coefficients(soft, soft, pair) == jkr.coefficients(soft, soft, pair)
    assert jkr_fixed_load.PAIR == jkr.PAIR
