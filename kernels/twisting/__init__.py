"""Twisting laws: torque against relative spin about the normal; one file each, the name in the scene.

A file defines ``build(real)``, cached, which returns

    torque(angle, rate, radius, stiffness, damping, load) -> torque along the normal [N m], twisting spring [rad]

and ``energy(angle, radius, stiffness)``, what its spring holds [J]. ``angle`` is the twist with this step's increment, ``rate``
the relative spin at the time of the force, ``radius`` that of the contact; stiffness and damping are those of the tangential
law, ``load`` is the friction coefficient times the Coulomb load (``contact.law``). Chosen by ``contact.twisting`` of the scene.
"""
