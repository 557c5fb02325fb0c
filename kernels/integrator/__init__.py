"""Time integrators: one file each; the file name is the name in the scene.

A file states ``ORDER`` (smooth forces), ``STAGES`` (times of the force calls in a step, in steps: its length is the number
of force calls), ``RELATIVE`` (velocities and spins are held relative to the frame; else absolute), ``STORE`` (vectors kept per
grain between the force calls of a step), ``PREDICTED = True`` where the velocity that dashpots see is v + (dt/2) a with a of
the force call before, one step ago (``contact.normal_law`` makes up for what that lacks), ``WEIGHS_JUMPS = False`` where the
fractions of ``contact.jumps`` are not those of its kicks, and, in its docstring, which terms of the frame it takes over.
``build`` returns

    advance(stage, i, state, a, b, row, frames, at, dt, store) -> state     after the force call of ``stage``
    reading(state, a, b, row, frames, at, dt) -> (velocity, spin)           at the time of the first force call of a step

``a``, ``b`` are acceleration and angular acceleration by all but the frame: contacts, gravity, fields. Whatever the scheme,
the record between two force calls reads: ``velocity`` (and ``spin``) is the mean over the way gone since the last first call of
a step, which is what springs slip by, and velocity + (dt/2) acceleration is what dashpots see.
"""
