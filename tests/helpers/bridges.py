"""Liquid bridges between equal spheres of radius 1: the axisymmetric Young-Laplace profile, integrated by another program.

Volume over R^3, contact angle [deg], gaps over R, force over 2 pi R g (to 1e-9), and rupture distance over R.
"""

YOUNG_LAPLACE = (
    (0.001, 0, (0.0, 0.01), (0.936149703, 0.617719396), 0.100773),
    (0.001, 30, (0.0, 0.01, 0.05, 0.1), (0.796636511, 0.532035629, 0.117752708, 0.043940233), 0.124460),
    (0.01, 0, (0.0, 0.01, 0.05, 0.1, 0.2), (0.884400512, 0.794567661, 0.473222035, 0.251425606, 0.092546993), 0.219049),
    (0.01, 30, (0.0, 0.05, 0.1, 0.2), (0.740575857, 0.411673473, 0.228188068, 0.100274163), 0.272492),
    (0.05, 0, (0.0, 0.05, 0.1, 0.2), (0.823566915, 0.660624195, 0.507007669, 0.298243168), 0.381462),
)  # fmt: skip
WORK = {(0.001, 0): 0.023105, (0.01, 0): 0.0680424, (0.01, 30): 0.0645220, (0.05, 0): 0.1412995, (0.05, 30): 0.137188}
"""Work from contact to rupture over 2 pi R^2 g, by volume and angle."""
