"""Normal laws: elastic and damping force along the normal of a contact; one file each, the file name is the name in the scene.

A file defines ``coefficients(a, b, pair)`` (host: 4 numbers per pair of materials), ``build(real)``, cached, which returns the
Warp functions ``constants`` and ``force``, and ``energy(overlap, stiffness)`` (NumPy) [J]. Signatures, units and what a law may
declare besides: ``contact.normal_law`` and the section "Your own model" of ``kernels/README.md``. Chosen by ``contact.normal``
of the scene.
"""

DEFAULT = "hertz"
