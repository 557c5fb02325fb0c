"""Rolling laws: torque against the relative rolling of two bodies in contact; one file each, the name in the scene.

A file defines ``HISTORY``, whether a contact remembers a rolling spring, and ``build(real)``, cached, which returns

    torque(spin, spin_predicted, angle, limit, spring, damping, inertia, dt) -> torque [N m], rolling spring [rad]

``limit`` is mu_r R* times the Coulomb load [N m] (``contact.law``). Chosen by ``contact.rolling`` of the scene.
"""
