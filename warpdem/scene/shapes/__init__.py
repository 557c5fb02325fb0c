"""Analytic walls as scene data, one shape a file: plane, cylinder, cone and sphere, by their key of ``[[walls]]``.

Each is one feature for the kernels. A shape with a solid side keeps grains on the other side; a cylinder or cone of finite
length is a thin sheet with open ends, solid from both sides.

``shape`` says what a shape has to say of itself: all that fills, checks, draws and repeats walls asks it. ``revolved`` is what
cylinder and cone share, ``lathe`` draws what is round an axis. What a new shape is: ``warpdem.kernels.wall``.
"""
