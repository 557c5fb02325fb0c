r"""Hertz contact that never attracts, damped so that the restitution asked for is obtained all the same.

    F_n = max(K d^(3/2) - C d^(1/4) v_n, 0),     C = sqrt(5) z sqrt(m* K)
    e   = exp(-2 z acos(z) / sqrt(1 - z^2))      for z < 1,     exp(-2 z acosh(z) / sqrt(z^2 - 1))   beyond

Symbols, K and the tangential stiffness are those of ``hertz``; z [-] follows from the restitution e and does not depend on the
speed. With u = d^(5/4) and ds = d^(1/4) dt the motion is that of a linear spring and dashpot, u'' + 2 z w u' + w^2 u = 0 with
w^2 = (5/4) K/m* (Antypov and Elliott 2011); the force vanishes where u'' does in the speed's own equation, half a period less
2 asin(z) after the touch (Schwager and Poeschel 2007, for linear springs). From there on the bodies part freely: spring and
dashpot are both at rest, and the overlap that is left is no force. It is the closed relation behind the fit of Thornton,
Cummins and Cleary 2013.

``hertz`` pulls at the end of an impact, and its friction goes by max(F_n, 0): the impulse that friction takes its limit from is
larger than m* (1 + e) v, by 3.3 % at e = 0.5. Here it is m* (1 + e) v to the last digit. Measured impacts do not distinguish
the two laws otherwise.

The dashpot of low e is strong, and the largest that a step allows (``contact.normal_law``) binds. Mean restitution by the steps
of an undamped contact:

    asked            0.05    0.1     0.2     0.3     0.5
    at 12 steps      0.209   0.210   0.222   0.297   0.499
    at 20            0.105   0.115   0.199   0.299   0.500
    at 40            0.050   0.100   0.200   0.300   0.500

For e below 0.3 take ``time.accuracy = "impact"``, some 40 steps; ``check`` prints the error of the step that is taken.
"""

import math

import numpy as np
from warpdem.kernels.normal import hertz

SUMMARY = "Hertz without attraction at the end"
PASSIVE = True
CLAMPED = True
TANGENT = hertz.TANGENT
build, stiffness, energy = hertz.build, hertz.stiffness, hertz.energy

NODES, WEIGHTS = np.polynomial.legendre.leggauss(64)


def given_back(ratio: float) -> float:
    """Restitution [-] at the damping ratio z [-]."""
    return math.exp(-ratio * _duration(ratio))


def damping_ratio(restitution: float) -> float:
    """Damping ratio z [-] that gives back ``restitution`` [-]: ``given_back`` the other way round."""
    low, high = 0.0, 1.0
    while given_back(high) > restitution:
        low, high = high, 2.0 * high
    for _ in range(60):  # more bits than a double has
        middle = 0.5 * (low + high)
        low, high = (middle, high) if given_back(middle) > restitution else (low, middle)
    return low


def coefficients(a, b, pair) -> tuple[float, float, float, float]:
    """Those of ``hertz``, but for the damping base sqrt(5) z [-]."""
    base, _, shear, shear_damping = hertz.coefficients(a, b, pair)
    return base, math.sqrt(5.0) * damping_ratio(pair.restitution), shear, shear_damping


def damped_time(restitution: float) -> float:
    """Time of contact over that without damping [-], from the closed path u(s); the free way out of the overlap counts."""
    ratio = damping_ratio(restitution)
    left = float(_path(ratio, np.array(_duration(ratio)))) ** 0.8  # overlap where the force ends, and the speed there is e
    return (_time(ratio) + 1.25 * left / restitution) / _time(0.0)


def _duration(ratio: float) -> float:
    """Length of the force in units of 1/w in s [-]."""
    root = math.sqrt(abs(1.0 - ratio**2))
    if root < 1.0e-6:
        return 2.0
    return 2.0 * (math.acos(ratio) if ratio < 1.0 else math.acosh(ratio)) / root


def _path(ratio: float, s: np.ndarray) -> np.ndarray:
    """The path u(s) over its first slope [-]."""
    root = math.sqrt(abs(1.0 - ratio**2))
    swing = np.sin(root * s) if ratio < 1.0 else np.sinh(root * s)
    return np.maximum(np.exp(-ratio * s) * (swing / root if root > 1.0e-6 else s), 0.0)


def _time(ratio: float) -> float:
    """Integral of ds / d^(1/4) from the touch to the end of the force, in units of its scale [-]."""
    end, x = _duration(ratio), 0.5 * (NODES + 1.0)
    # s^(-1/5) at the touch, and at the end, too, without damping: both halves are taken from their ends outwards by x^(5/4)
    s = np.concatenate([0.5 * end * x**1.25, end - 0.5 * end * x**1.25])
    weight = np.tile(0.5 * WEIGHTS * 0.5 * end * 1.25 * x**0.25, 2)
    return float(np.sum(weight * _path(ratio, s) ** -0.2))
