"""Liquid bridges: the force of a bridge of given volume; one file each, the name in the scene.

A file defines

    FORMED = {name: unit}         what a bridge of a volume keeps beside its rupture distance and c^2 = V/(pi R*)
    rupture(volume, radius, wetting) -> rupture distance [m], on the host
    force(gap, volume, radius, tension, wetting) -> pull of a bridge [N], on the host
    energy(gap, pull, square, rupture, *formed) -> energy of a bridge [J], 0 at its rupture, on the host
    build(real), cached, which returns

        formed(volume, radius, tension, wetting) -> vector: rupture distance, c^2, then FORMED: once, as a bridge forms
        force(gap, pull, bridge) -> pull of a bridge [N]; in the lanes of registers (``contact.sweep``)
        work(pull, bridge) -> its work from contact to rupture [J], likewise

``radius`` is R*, ``wetting`` the cosine of the contact angle, ``tension`` the surface tension g [N/m], ``pull`` [N] is
4 pi R* g cos(theta) of the contact, ``bridge`` what ``formed`` gave. When bridges form and break, and what becomes of the
liquid: ``contact.liquid``. Chosen by ``contact.liquid`` of the scene.
"""
