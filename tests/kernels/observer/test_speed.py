import warp as wp
from warpdem.kernels.field import Numbers
from warpdem.kernels.observer import speed


def test_speed_is_the_length_of_the_velocity_and_of_nothing_else():
    one, far = wp.float64(1.0), wp.vec3d(7.0, 8.0, 9.0)
    assert float(speed.build()(far, wp.vec3d(2.0, -3.0, 6.0), far, one, one, one, Numbers())) == 7.0
