"""External fields: forces that the scene imposes on each grain; one file each, the file name is the name in the scene.

A file states ``PARAMETERS``: name -> (unit, numbers, default): the unit as in scene files, 1 or 3 numbers, the default or None
where the scene must give them; at most ``NUMBERS`` in all. ``build()``, cached, returns

    force(q, v, mass, radius, time, p) -> F     [m], [m/s], [kg], [m], [s], Numbers -> [N]

q and v are position and velocity in the axes that the field lives in (the scene's ``axes``): absolute in laboratory axes, or
in frame axes with v relative to the frame. F is in the same axes. p holds the parameters one after the other, in SI units.
A field that pulls back, brakes or rotates also has ``rate(mass, p)`` (NumPy): the largest rate [rad/s] at which it changes the
motion of grains of ``mass`` [kg], shape (n,); the time step is chosen from it. Without it only the contacts limit the step.
A field with a potential also has ``energy(position, mass, radius, p)`` (NumPy): potential energy [J], shape (n,), of grains at
``position``, shape (n, 3).
"""

import warp as wp

NUMBERS = 12
Numbers = wp.types.vector(NUMBERS, wp.float64)
