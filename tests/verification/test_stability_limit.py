"""The step at which a packing and a single contact become unstable is that of the rule of ``engine.timestep``, within 7 %."""

import math

import numpy as np
import pytest

import stability_scenes as scenes
from warpdem import StabilityError

LAWS = [("hooke", 0.0), ("hooke", 0.1), ("hooke", 2.0 / 7.0), ("hooke", 1.0), ("hertz", 1.0)]
"""Normal law, and k_t/k_n (any but 0 with hertz: 0.82 by Poisson's ratio)."""


@pytest.mark.parametrize("restitution", [1.0, 0.5, 0.1])
@pytest.mark.parametrize(("normal", "ratio"), LAWS)
@pytest.mark.parametrize(
    ("make", "limit"),
    [(scenes.packing, scenes.packing_rule), (scenes.pressed, scenes.contact_rule)],
    ids=["packing", "pair"],
)
def test_a_disturbance_grows_above_the_limit_and_not_below(device, make, limit, normal, ratio, restitution):
    """Speeds of 1e-11 m/s in contacts at equilibrium, so that their stiffness stays what it is."""
    rule = limit(make(normal, ratio, restitution, 1e-6, device))
    assert not scenes.grows(make(normal, ratio, restitution, 0.93 * rule, device))
    assert scenes.grows(make(normal, ratio, restitution, 1.07 * rule, device))


def test_an_explosion_within_periodic_borders_ends_in_words(device):
    """A grain thrown across the whole domain in one step cannot be brought back by one wrap."""
    rule = scenes.packing_rule(scenes.packing("hooke", 0.0, 1.0, 1e-6, device))
    sim = scenes.packing("hooke", 0.0, 1.0, 2.0 * rule, device)
    with pytest.raises(StabilityError, match=r"grain \d+ .*(crossed the whole periodic domain|not finite)"):
        sim.step(2000)
    assert np.isfinite(sim.dt) and math.isfinite(rule)
