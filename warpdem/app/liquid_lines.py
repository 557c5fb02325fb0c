"""What ``warpdem check`` says of the liquid of a scene."""

from collections.abc import Iterator, Sequence
from typing import Any


def bridge_lines(rows: Sequence[dict[str, Any]]) -> Iterator[str]:
    """The first liquid bridges of what may touch; rows as of ``model.liquid_numbers.Bridge``."""
    for row in rows:
        other = f"a wall of {row['materials'][1]}" if row["wall"] else row["materials"][1]
        weight = "" if row["bond_number"] is None else f", {row['bond_number']:.3g} of its weight (granular Bond number)"
        yield (
            f"liquid between {row['materials'][0]} (radius {row['radius']:.3g} m) and {other}: the first bridge holds "
            f"{row['volume']:.3g} m3, pulls with {row['pull']:.3g} N in contact{weight}, breaks at a gap of "
            f"{row['rupture']:.3g} m ({row['rupture'] / row['radius']:.2g} of the radius); undamped impacts below "
            f"{row['sticking_speed']:.3g} m/s do not part"
        )
