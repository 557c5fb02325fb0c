"""Tangential laws: what is kept of the tangential spring when the overlap changes; one file each, the name in the scene.

A file defines ``build(real)``, cached, which returns ``kept(overlap, overlap_before)``, the fraction of the spring that is kept
[-]. Slip, dashpot and Coulomb's limit are the same for all of them (``contact.law``); stiffness and damping come from the
normal law. Chosen by ``contact.tangential`` of the scene.
"""

DEFAULT = "mindlin"
