"""How much of a stream is due at a time, and which portion of its recipe comes next."""

import itertools
import math
from collections.abc import Sequence

from warpdem.scene.streams import Stream


def brought_by(stream: Stream, time: float) -> float:
    """Amount that the rate of a stream gives from its start to ``time`` [s]: grains [-] or mass [kg]; inf without a rate.

    At a constant rate this is rate times elapsed time; a table is integrated over its straight lines.
    """
    rate = stream.count_rate or stream.mass_rate
    end = time if stream.until is None else min(time, stream.until)
    elapsed = max(0.0, end - stream.start)
    if rate is None:
        return math.inf if time >= stream.start else 0.0
    if isinstance(rate, list):
        return _integral(rate, end) - _integral(rate, stream.start) if elapsed else 0.0
    return float(rate) * elapsed


def _integral(table: Sequence[tuple[float, float]], end: float) -> float:
    """Integral of a rate from the first row of its table to ``end`` [s]; the rate is constant before and after the rows."""
    (first, rate), (last, final) = table[0], table[-1]
    total = rate * min(end - first, 0.0) + final * max(end - last, 0.0)
    for (t0, r0), (t1, r1) in itertools.pairwise(table):
        part = min(max(end, t0), t1) - t0
        total += part * (r0 + 0.5 * part * (r1 - r0) / (t1 - t0))
    return total


def highest_rate(stream: Stream) -> float:
    """Highest rate of a stream [1/s or kg/s]; inf without a rate."""
    rate = stream.count_rate or stream.mass_rate
    if isinstance(rate, list):
        return max(value for _, value in rate)
    return math.inf if rate is None else float(rate)


def total_of(stream: Stream) -> float:
    """Total of a stream, grains [-] or mass [kg]; inf without one."""
    return float(stream.count or stream.mass or math.inf)


def next_portion(stream: Stream, brought: Sequence[float]) -> int:
    """Number of the portion that is furthest behind its share, given what of each was brought, by mass [kg] or number [-]."""
    parts = [amount / portion.share for amount, portion in zip(brought, stream.portions, strict=True)]
    return parts.index(min(parts))


def mean_mass(stream: Stream, masses: Sequence[float]) -> float:
    """Mean mass of the grains and clumps of a stream [kg], given that of each portion [kg]."""
    shares = [portion.share for portion in stream.portions]
    if stream.by_mass:
        return sum(shares) / sum(share / mass for share, mass in zip(shares, masses, strict=True))
    return sum(share * mass for share, mass in zip(shares, masses, strict=True)) / sum(shares)


def mean_members(stream: Stream, masses: Sequence[float], members: Sequence[int]) -> float:
    """Mean number of grains that a body of a stream has, given the mean mass [kg] and the members of each portion."""
    shares = [portion.share for portion in stream.portions]
    if stream.by_mass:
        shares = [share / mass for share, mass in zip(shares, masses, strict=True)]
    return sum(share * count for share, count in zip(shares, members, strict=True)) / sum(shares)
