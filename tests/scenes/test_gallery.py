"""The scenes of the gallery come out as their first lines say: quick forms of each, and each in full (slow)."""

import math

import numpy as np
import pytest

import warpdem
from outcomes import (
    centre_angle,
    cone_angle,
    instants,
    jacobi,
    mean_angular_velocity,
    simulation,
    solid_fraction,
    surface_curvature,
    time_in_air,
)

# --- quick ----------------------------------------------------------------------------------------------------------


def test_marbles_are_back_after_seven_half_turns():
    sim = simulation("disk", "time.step='20 us'")
    p = sim.particles
    start, circle = p.position_lab, np.linalg.norm(p.velocity_lab, axis=1) / (2.0 / 7.0 * 20.0)
    np.testing.assert_allclose(circle, [0.00875, 0.0175, 0.02625, 0.035], rtol=1e-12)
    sim.run(until=0.5 * sim.scene.time.end)
    away = np.linalg.norm(sim.particles.position_lab - start, axis=1)
    np.testing.assert_allclose(away, 2.0 * circle, rtol=0.01)
    sim.run(until=sim.scene.time.end)
    assert (np.linalg.norm(sim.particles.position_lab - start, axis=1) < 0.01 * circle).all()


def test_drum_starts_alike_in_both_views():
    # two layers on the wall, while the drum gathers speed; later each contact makes small differences larger
    few = [f"grains.{k}.fill={{box={{min={low},max={high}}},count=60,diameter='5 mm'}}"
           for k, (low, high) in enumerate([([-0.04, -0.013, -0.02], [0.04, 0.013, 0.0]),
                                            ([-0.03, -0.013, -0.039], [0.03, 0.013, -0.022])])]  # fmt: skip
    turning, resting = simulation("drum", *few), simulation("drum_laboratory", *few)
    for sim in (turning, resting):
        sim.run(until=0.04)
    assert turning.extremes["wall_overlap_share"] > 0.001
    apart = np.linalg.norm(turning.particles.position_lab - resting.particles.position_lab, axis=1)
    assert apart.max() < 1e-6 * turning.particles.radius.max()


def kiln(turns: str, seed: int = 0):
    """The kiln, with the drum at rest in its turning frame, or turning in the laboratory."""
    one = warpdem.load_demo("kiln")
    data = {**one.model_dump(mode="json", exclude_unset=True), "base": one.base}
    for stream in data["streams"]:
        stream["seed"] = seed
    if turns == "drum":
        motion = data.pop("frame")
        data["walls"] = [{**wall, "motion": motion} for wall in data["walls"]]
    return warpdem.Simulation(warpdem.Scene.model_validate(data), device="cpu", threads=1)


def test_kiln_starts_alike_in_both_views():
    turning, resting = kiln("frame"), kiln("drum")
    for sim in (turning, resting):
        sim.run(until=0.3)
    assert turning.inlets[0].mass == resting.inlets[0].mass > 0.0
    assert turning.extremes["wall_overlap_share"] > 0.001
    assert turning.particles.id.tolist() == resting.particles.id.tolist()
    apart = np.linalg.norm(turning.particles.position_lab - resting.particles.position_lab, axis=1)
    assert len(apart) > 5
    assert apart.max() < 1e-6 * turning.particles.radius.max()


@pytest.mark.slow
def test_kiln_holds_alike_in_both_views():
    held = {}
    for turns in ("frame", "drum"):
        mean = []
        for seed in range(3):
            runs = instants(kiln(turns, seed), 10.0, 0.05, start=6.0)
            mean.append(np.mean([sim.particles.mass.sum() for sim in runs]))
        held[turns] = np.mean(mean)
    assert abs(held["frame"] / held["drum"] - 1.0) < 0.02
    assert abs(held["frame"] / 0.012 / 3.8 - 1.0) < 0.3


@pytest.mark.slow
def test_kiln_lets_out_what_is_fed_after_the_time_that_its_hold_up_takes():
    """In a steady state the mean residence time is the number held over the number that leaves per second."""
    sim = kiln("frame")
    rows = [(s.time, *s.left["discharge"], s.measure()) for s in instants(sim, 20.0, 0.05, start=10.0)]
    (t0, n0, m0, _), (t1, n1, m1, found) = rows[0], rows[-1]
    assert abs((m1 - m0) / ((t1 - t0) * 0.012) - 1.0) < 0.03
    held = np.mean([row[-1]["region hold-up grains [-]"] for row in rows])
    tracers, mean, deviation = (found[f"residence tracer {what}"] for what in ("grains [-]", "mean [s]", "deviation [s]"))
    assert 0.98 * sim.inlets[1].count < tracers <= sim.inlets[1].count and tracers > 250
    assert abs(mean / (held * (t1 - t0) / (n1 - n0)) - 1.0) < 0.05  # of 310 times: a standard error of 1.4 %
    assert 0.15 < deviation / mean < 0.4


def test_mill_pins_its_balls_when_the_jar_turns_fast():
    far = away_from_wall("frame.1.rate='900 rpm'", until=0.08, start=0.05)
    assert far < 0.1


def test_motor_starts_the_ball_mill():
    """Few balls: motor and balls account for its kinetic energy, and its rate is below that of an empty drum."""
    few = "grains.0.fill={box={min=[-0.02,0.0005,-0.034],max=[0.02,0.0195,-0.02]},count=30,diameter='5 mm',seed=1}"
    sim = simulation("ball_mill", few)
    sim.run(until=0.06)
    now = sim.measure()
    drum = sim.schedule.dynamic[0]
    kinetic = 0.5 * 1e-4 * drum.value("predicted") ** 2
    assert drum.value("driven") - now["drum work [J]"] == pytest.approx(kinetic, rel=1e-3)
    assert 0.5 < drum.value("predicted") / (12 * (1 - math.exp(-0.06 * 0.03 / (1e-4 * 12)))) < 0.999


def test_bed_stays_on_the_plate_below_the_acceleration_of_gravity():
    sim = simulation("shaker", "frame.amplitude=[0,0,'2 mm']", "grains.0.fill.box.max=[0.016,0.016,0.016]")
    time, load = plate_load(sim, until=0.15, start=0.05)
    expected = 1.0 - 2e-3 * (20.0 * math.pi) ** 2 / 9.81 * np.sin(20.0 * math.pi * time)
    assert abs(load - expected).max() < 0.1
    assert abs(load.mean() - 1.0) < 0.02


def test_three_sticky_grains_hang_and_of_four_three_fall():
    sim = simulation("hanging_chain")
    start = sim.particles.position
    sim.run(until=sim.scene.time.end)
    fallen = start - sim.particles.position
    assert np.abs(fallen[:3]).max() < 1e-10
    assert abs(fallen[3, 2]) < 2e-6
    assert ((fallen[4:, 2] > 11.9e-3) & (fallen[4:, 2] < 12.3e-3)).all()
    assert np.ptp(fallen[4:, 2]) < 1e-5


def test_chute_keeps_the_jacobi_integral():
    loss, count = loss_in_chute(simulation("turning_chute", "streams.0.count_rate=120"), until=0.26)
    assert count >= 5
    assert 0.0 < loss < 0.03


def test_pile_holds_what_the_stream_brings():
    sim = simulation("pile", "streams.0.count_rate=400")
    sim.run(until=0.15)
    assert abs(len(sim.particles.id) - 60) <= 6
    assert (sim.particles.position[:, 2] > 0.9 * sim.particles.radius).all()


def test_hopper_lets_out_what_it_held():
    sim = simulation("hopper", "grains.0.fill.region.max=[0.05,0.05,0.02]", "grains.0.fill.solid_fraction=0.3")
    start = sim.particles.mass.sum()
    sim.run(until=0.11)
    count, mass = sim.left["hole"]
    assert count > 10
    np.testing.assert_allclose(mass + sim.particles.mass.sum(), start, rtol=1e-12)


def test_spinning_grains_move_outwards():
    sim = simulation("centrifuge", "grains.0.fill.solid_fraction=0.1")
    start = np.hypot(*sim.particles.position[:, :2].T).mean()
    sim.run(until=0.08)
    assert np.hypot(*sim.particles.position[:, :2].T).mean() > 1.1 * start
    assert np.hypot(*sim.particles.position[:, :2].T).max() < 0.04


def test_belt_takes_what_falls_on_it_along():
    sim = simulation("belt", "time.step='28 us'", "engine.max_overlap=0.2")
    sim.run(until=0.3)
    found = sim.measure()
    assert found["region bed grains [-]"] > 20
    assert abs(found["region bed velocity_x [m/s]"] - 0.6) < 0.02


def test_screw_pushes_what_lies_before_its_flight():
    sim = simulation("screw")
    sim.run(until=0.5)
    p = sim.particles
    lying = p.position[:, 2] < -0.012
    assert lying.sum() > 40
    assert abs(np.average(p.velocity[lying, 0], weights=p.mass[lying]) - 0.08) < 0.03


def test_screen_lets_small_grains_through():
    sim = simulation("screen", "time.step='25 us'", "engine.max_overlap=0.3")
    sim.run(until=0.3)
    found = sim.measure()
    assert found["residence small_under grains [-]"] > 10
    assert found["residence large_under grains [-]"] == 0


def test_lid_of_the_shear_cell_comes_down_and_bears_its_load():
    low = ("walls.1.translate=[0.024,0,0.008]", "grains.0.fill.box.max=[0.024,0.012,0.008]")
    pressure, above, below = sheared(simulation("shear_cell", *low), 0.04, 0.03)
    assert abs(pressure / 2000.0 - 1.0) < 0.01
    assert above > 0.05 and abs(above - below) < 0.05


# --- in full --------------------------------------------------------------------------------------------------------


@pytest.mark.slow
@pytest.mark.parametrize(
    ("energy", "angle", "swing"),
    [(0.0, (32.0, 36.0), (0.0, 1.4)), (0.2725, (34.8, 36.8), (1.0, 2.2)), (0.545, (36.1, 38.1), (1.3, 2.6)),
     (1.09, (37.0, 41.0), (1.5, 2.6))],
    ids=["dry", "Bond 1", "Bond 2", "Bond 4"],
)  # fmt: skip
def test_sticky_grains_stand_steeper_in_a_drum_and_fall_in_larger_avalanches(energy, angle, swing):
    sim = simulation("sticky_drum", f"pairs.0.surface_energy={energy}")
    angles = [centre_angle(s) for s in instants(sim, sim.scene.time.end, 0.005, start=3.0)]
    assert angle[0] < np.mean(angles) < angle[1]
    assert swing[0] < np.std(angles) < swing[1]


@pytest.mark.slow
def test_hopper_follows_beverloos_law():
    sim = simulation("hopper")
    end, left, bulk = sim.scene.time.end, [], 0.0
    for k in (1, 2, 3):
        sim.run(until=0.25 * k * end)
        left.append((sim.time, sim.left["hole"][1]))
        if k == 2:
            bulk = 2500.0 * solid_fraction(sim, 0.015, 0.04, 0.0, 0.038)
    (t1, m1), (t2, m2), (t3, m3) = left
    second, third = (m2 - m1) / (t2 - t1), (m3 - m2) / (t3 - t2)
    assert abs(second / third - 1.0) < 0.15  # nine seeds: at most 0.13 at 8, 0.11 at 12 steps in the contact time
    beverloo = 0.58 * bulk * math.sqrt(9.81) * (0.04 - 1.4 * 0.006) ** 2.5
    assert abs(beverloo - 0.45) < 0.02
    assert abs(second / beverloo - 1.0) < 0.2


@pytest.mark.slow
def test_drum_flows_alike_in_both_views():
    mean = []
    for name in ("drum", "drum_laboratory"):
        angle = np.array([centre_angle(sim) for sim in instants(simulation(name), 1.2, 0.02, start=0.6)])
        assert 40.0 < angle.mean() < 47.0
        assert abs(angle - angle.mean()).max() < 3.0
        mean.append(angle.mean())
    assert abs(mean[0] - mean[1]) < 1.5


@pytest.mark.slow
def test_mill_scales_with_its_rate():
    assert abs(share_of_speed() - 0.43) < 0.04
    slow = ("gravity=[0,0,0]", "frame.0.rate='150 rpm'", "frame.1.rate='-300 rpm'")
    assert abs(share_of_speed(*slow, slowness=2.0) - share_of_speed("gravity=[0,0,0]")) < 0.02
    assert 0.30 < away_from_wall(until=0.3, start=0.1) < 0.45
    assert away_from_wall("frame.1.rate='900 rpm'", until=0.3, start=0.1) < 0.03


@pytest.mark.slow
def test_ball_mill_turns_as_motor_and_balls_agree():
    sim = simulation("ball_mill")
    drum, rates, works = sim.schedule.dynamic[0], [], []
    for _ in instants(sim, until=sim.scene.time.end, interval=0.01, start=0.5):
        rates.append(drum.value("predicted"))
        works.append((drum.value("driven"), sim.measure()["drum work [J]"]))
    driven, done = np.ptp(np.array(works), axis=0)
    assert done == pytest.approx(driven, rel=0.01)
    assert 7.0 < np.mean(rates) < 10.0
    assert np.ptp(rates) < 0.2 * np.mean(rates)


@pytest.mark.slow
def test_shaken_bed_flies_and_lands():
    sim = simulation("shaker")
    assert abs(time_in_air(2.0) - 0.74) < 0.01
    _, load = plate_load(sim, until=0.7, start=0.2)
    assert abs((load < 0.05).mean() - time_in_air(2.0)) < 0.1
    assert abs(load.mean() - 1.0) < 0.02


@pytest.mark.slow
def test_centrifuge_makes_a_paraboloid():
    sim = simulation("centrifuge")
    sim.run(until=sim.scene.time.end)
    rate, r = sim.scene.frame[0].rate, 0.03
    slope = math.degrees(math.atan(2.0 * surface_curvature(sim, 6e-3, 0.034) * r))
    assert 4.0 < math.degrees(math.atan(rate**2 * r / 9.81)) - slope < 9.0
    assert abs(mean_angular_velocity(sim)) < 0.01 * rate


@pytest.mark.slow
def test_pile_stands_at_its_angle_of_repose():
    sim = simulation("pile")
    sim.run(until=sim.scene.time.end)
    assert 25.0 < cone_angle(sim) < 33.0
    assert np.linalg.norm(sim.particles.velocity, axis=1).max() < 5e-3
    flat = simulation("pile", "pairs.0.rolling_friction=0", "streams.0.until=0.5")
    flat.run(until=1.0)
    assert flat.particles.position[:, 2].max() < 0.006


@pytest.mark.slow
def test_a_wet_heap_stands_where_a_dry_one_runs_flat():
    wet, dry = simulation("wet_heap"), simulation("wet_heap", "grains.0.liquid_content=0")
    brought = wet.liquid().brought
    for sim in (wet, dry):
        sim.run(until=sim.scene.time.end)
    assert 40.0 < cone_angle(wet) < 49.0
    assert 10.0 < cone_angle(dry) < 15.0
    assert np.linalg.norm(wet.particles.velocity, axis=1).max() < 5e-3
    assert 2.4 < wet.liquid().bridge_count / len(wet.state) < 2.9
    assert wet.liquid().brought == brought


@pytest.mark.slow
def test_chute_in_full():
    loss, count = loss_in_chute(simulation("turning_chute"), until=0.8)
    assert count > 20
    assert 0.0 < loss < 0.03


@pytest.mark.slow
def test_belt_carries_a_heap_and_throws_it_as_a_parabola():
    sim = simulation("belt")
    rows = [(s.time, s.measure()) for s in instants(sim, 2.0, 0.01, start=1.2)]
    (t0, first), (t1, last) = rows[0], rows[-1]

    def mean(name):
        return np.mean([row[name] for _, row in rows])

    def rate(name):
        return (last[name] - first[name]) / (t1 - t0)

    assert abs(mean("region bed velocity_x [m/s]") / 0.6 - 1.0) < 0.01
    assert abs(rate("flow middle mass [kg]") / 0.048 - 1.0) < 0.05
    drop = mean("region head centre_z [m]") - mean("region jet centre_z [m]")
    assert abs(drop - 0.05**2 * 9.81 / (2.0 * 0.36)) < 0.003
    assert abs(rate("belt work [J]") / (0.048 * 0.36) - 1.0) < 0.05


@pytest.mark.slow
def test_screw_is_plug_flow_of_its_pitch():
    sim = simulation("screw")
    speed = np.mean([s.measure()["region bed velocity_x [m/s]"] for s in instants(sim, 3.0, 0.02, start=1.5)])
    assert abs(speed / 0.08 - 1.0) < 0.04
    found = sim.measure()
    assert found["residence tracer grains [-]"] == sim.inlets[1].count > 60
    assert abs(found["residence tracer mean [s]"] / 1.29 - 1.0) < 0.08
    assert found["residence tracer deviation [s]"] < 0.25


@pytest.mark.slow
def test_screen_parts_two_sizes():
    sim = simulation("screen")
    sim.run(until=sim.scene.time.end)
    found = sim.measure()
    small = [found[f"residence small_{way} grains [-]"] for way in ("under", "over")]
    assert found["residence large_under grains [-]"] == 0 and sim.left["feed_end"][0] == 0
    assert small[0] > 100 and small[0] > 0.95 * sum(small)
    assert found["residence large_over grains [-]"] > 20
    assert found["residence large_over mean [s]"] < 1.5


@pytest.mark.slow
@pytest.mark.parametrize("load", [2, 4])
def test_grains_in_the_shear_cell_have_the_friction_of_glass_beads(load):
    stiffer = (f"walls.1.servo.pressure='{load} kPa'", f"time.max_speed='{0.1 if load == 2 else 0.3} m/s'")
    pressure, above, below = sheared(simulation("shear_cell", *stiffer), 1.5, 0.5)
    assert abs(pressure / (1e3 * load) - 1.0) < 0.01
    assert abs(above - 0.38) < 0.04 and abs(above - below) < 0.005


# --- measured by several --------------------------------------------------------------------------------------------


def plate_load(sim, until: float, start: float) -> tuple[np.ndarray, np.ndarray]:
    """Instants [s] and the plate's load over the bed's weight."""
    weight = 9.81 * sim.particles.mass.sum()
    rows = [(s.time, -s.wall_loads(lab=True)["plate"].force[2] / weight) for s in instants(sim, until, 5e-4, start)]
    return np.array(rows).T


def away_from_wall(*overrides: str, until: float, start: float) -> float:
    """Share of balls and instants at which a ball of 4 mm is more than 2 mm off the wall of the mill's jar."""
    sims = instants(simulation("planetary_mill", *overrides), until, 1e-3, start)
    away = [np.hypot(s.particles.position[:, 0] - 0.08, s.particles.position[:, 1]) < 0.019 for s in sims]
    return float(np.mean(away))


def share_of_speed(*overrides: str, slowness: float = 1.0) -> float:
    """Root mean square speed of the mill's balls in its jar, over that of the jar on the disk."""
    sim = simulation("planetary_mill", *overrides)
    square = [(s.particles.velocity**2).sum(1).mean() for s in instants(sim, 0.3 * slowness, 1e-3, 0.1 * slowness)]
    return math.sqrt(np.mean(square)) / (0.08 * sim.scene.frame[0].rate)


def loss_in_chute(sim, until: float) -> tuple[float, int]:
    """Mean loss of the Jacobi integral over the gain in v^2/2, and how many grains have left the chute."""
    sim.run(until=until)
    [stream], rate = sim.scene.streams, sim.scene.frame[0].rate
    centre = 0.5 * (np.array(stream.box.min) + stream.box.max)
    speed = 0.5 * np.dot(stream.velocity, stream.velocity)
    start = speed - 0.5 * rate**2 * centre[0] ** 2 + 9.81 * centre[2]
    out = (sim.particles.position - [0.02, 0.0, 0.0]) @ [math.sqrt(0.5), 0.0, -math.sqrt(0.5)] > 0.305
    gain = 0.5 * (sim.particles.velocity[out] ** 2).sum(1).mean() - speed
    return float((start - jacobi(sim)[out].mean()) / gain), int(out.sum())


def sheared(sim, until: float, start: float) -> tuple[float, float, float]:
    """Mean normal stress on the lid [Pa], and shear forces on lid and floor over its normal force, from ``start`` [s] on."""
    sim.run(until=until, record=1e-3)
    late = sim.history["time"] > start
    lid, along, below = (np.mean(sim.history[name][late]) for name in ("lid force z", "lid force x", "floor force x"))
    return lid / (0.024 * 0.012), along / lid, -below / lid
