"""Observers: one number per grain, read while the run goes on, for columns of history.csv; a file each, like the fields.

A file states ``UNIT``, the unit of its number as the header of a column shows it, and ``PARAMETERS`` as a field does (see
``kernels.field``). ``build()``, cached, returns

    observe(q, v, w, mass, radius, time, p) -> value     [m], [m/s], [rad/s], [kg], [m], [s], Numbers -> [UNIT]

q, v and w are position, velocity and spin at the present time in the axes of the observer: absolute in laboratory axes,
or in frame axes with v and w relative to the frame. p holds the parameters one after the other, in SI units. It writes
nothing, so that what is observed never changes the run.
"""

import functools

import warp as wp
from warpdem.kernels import MODULE_OPTIONS
from warpdem.kernels.field import Numbers


@functools.cache
def build_each(observe):
    """Return the kernel that reads a number off each grain."""

    @wp.kernel(enable_backward=False, module="unique", module_options=MODULE_OPTIONS)
    def each(
        # grains, read
        position: wp.array(dtype=wp.vec3d),
        velocity: wp.array(dtype=wp.vec3d),
        spin: wp.array(dtype=wp.vec3d),
        mass: wp.array(dtype=wp.float64),
        radius: wp.array(dtype=wp.float64),
        time: wp.float64,
        p: Numbers,
        # written
        value_out: wp.array(dtype=wp.float64),
    ):
        i = wp.tid()
        value_out[i] = observe(position[i], velocity[i], spin[i], mass[i], radius[i], time, p)

    return each
