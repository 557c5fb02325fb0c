"""At rest, and falling, in a turning frame (exact_solutions 7, flow_laws 3 and 4): closed forms without round-about.

Grains are kept from rolling by a rolling spring with friction above that of sliding: they are blocks.

    on a disk            rest while Om^2 r <= mu g
    in a drum            rest on the wall while Om^2 r >= g sqrt(1 + 1/mu^2): the largest of cos(a) + sin(a)/mu
    let go in the frame  sideways (1/3) Om g t^3, where gravity turns with the frame
"""

import math

import numpy as np
import pytest

G, RADIUS, MU = 9.81, 5e-3, 0.3
BLOCK = {
    "radius": RADIUS, "young_modulus": 5e6, "restitution": 0.2, "tangential": "mindlin", "rolling": "spring",
    "rolling_damping": 0.5, "step": 4e-5, "engine": {"skin": 1.0},
}  # fmt: skip


def test_blocks_hold_on_a_turning_disk_up_to_mu_g(make_simulation):
    """The disk takes 2 s to reach its rate, so that Om' r adds 0.1 % to Om^2 r; a rim stands far outside."""
    rate = 10.0
    share = np.array([0.3, 0.7, 0.97, 1.03, 1.1])  # of the radius mu g/Om^2
    turn = np.arange(5) * 2.0 * math.pi / 5
    r = share * MU * G / rate**2
    place = np.stack([r * np.cos(turn), r * np.sin(turn), np.full(5, RADIUS - 1e-5)], axis=1)
    sim = make_simulation(
        place.tolist(), gravity=[0, 0, -G], friction=MU, rolling_friction=1.0,
        walls=[{"name": "disk", "plane": {"point": [0, 0, 0], "normal": [0, 0, 1]}},
               {"name": "rim", "cylinder": {"point": [0, 0, 0], "axis": [0, 0, 1], "radius": 0.5}}],
        frame={"axis": [0, 0, 1], "schedule": [{"until": 2.0, "rate": [0, rate]}, {"rate": rate}]}, **BLOCK,
    )  # fmt: skip
    sim.run(until=2.5)
    way = np.linalg.norm((sim.particles.position - place)[:, :2], axis=1)
    assert np.all(way[share < 1] < 0.01 * RADIUS)
    assert np.abs(sim.particles.velocity[share < 1]).max() < 1e-4
    assert np.all(way[share > 1] > 0.1 * RADIUS)
    out = np.hypot(*sim.particles.position[:, :2].T) - r
    assert np.all(out[share > 1] > 0.05 * RADIUS)


@pytest.mark.parametrize("share", [0.98, 1.02])
def test_a_block_goes_round_with_a_drum_above_its_rate(make_simulation, share):
    """Mu = 2: at 2 % more than the square of the rate it stays in place for two turns, at 2 % less it slips on each of them."""
    drum, mu = 0.05, 2.0
    # its centre goes on the circle R - r
    rate = math.sqrt(share * G * math.sqrt(1.0 + 1.0 / mu**2) / (drum - RADIUS))
    place = np.array([0.0, 0.0, -(drum - RADIUS + 1e-6)])
    sim = make_simulation(
        [place.tolist()], gravity=[0, 0, -G], friction=mu, rolling_friction=1.1 * mu,
        walls=[{"name": "drum", "cylinder": {"point": [0, 0, 0], "axis": [0, 1, 0], "radius": drum}},
               {"name": "end", "plane": {"point": [0, -0.1, 0], "normal": [0, 1, 0]}}],
        frame={"axis": [0, 1, 0], "rate": rate}, **BLOCK,
    )  # fmt: skip
    sim.run(until=2.0 * 2.0 * math.pi / rate)
    way = np.linalg.norm(sim.particles.position[0] - place)
    assert way < 0.02 * RADIUS if share > 1 else way > 0.1 * RADIUS


@pytest.mark.parametrize("tilt", [0.0, 0.6], ids=["level", "latitude"])
@pytest.mark.parametrize("carried", [False, True], ids=["gravity of the laboratory", "gravity of the frame"])
def test_a_stone_let_go_in_the_frame_falls_sideways(make_simulation, tilt, carried):
    """(1/3) Om g cos(latitude) t^3 to the east, where gravity goes round with the frame, as on Earth.

    Gravity of the laboratory turns away by Om t meanwhile, which makes it 1/2. The axis stands at the latitude over the
    horizon; the next order is (Om t)^2 of the fall.
    """
    rate, end = 0.02, 0.5
    mass = 2500.0 * 4.0 / 3.0 * math.pi * 1e-3**3
    weight = {"model": "lorentz", "axes": "frame", "parameters": {"charge": mass, "electric": [0, 0, -G]}}
    sim = make_simulation(
        [[0.0, 0.0, 0.0]], gravity=[0, 0, 0 if carried else -G], fields=[weight] if carried else [], spins=[[0, 0, 1.0]],
        frame={"axis": [0, math.cos(tilt), math.sin(tilt)], "rate": rate}, step=1e-3, young_modulus=1.0,
    )  # fmt: skip
    sim.run(until=end)
    east, north, up = sim.particles.position[0]
    assert up == pytest.approx(-0.5 * G * end**2, rel=(rate * end) ** 2)
    share = 1.0 / 3.0 if carried else 0.5
    assert east == pytest.approx(share * rate * G * math.cos(tilt) * end**3, rel=(rate * end) ** 2)
    assert abs(north) < (rate * end) ** 2 * abs(up)
