"""What ``warpdem check`` says of each clump: mass, members, how well they fill a mesh, and what the time step goes by."""

from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np

from warpdem.filling.clump_grains import placed
from warpdem.filling.clump_template import ClumpTemplate, clump_templates
from warpdem.scene.model import Scene


def clump_rows(scene: Scene) -> list[dict[str, Any]]:
    """Numbers of each clump at size 1, once for each material that it is of: JSON can hold them, all in SI."""
    rows = []
    for number, (name, template) in enumerate(clump_templates(scene).items()):
        portions: list[Any] = list(scene.grains)
        for stream in scene.streams:
            portions += stream.recipe or [stream]
        materials = [portion.material for portion in portions if portion.clump == name]
        for material in dict.fromkeys(str(one) for one in materials):
            rows.append(_row(template, number, material, scene.materials[material].density))
    return rows


def _row(template: ClumpTemplate, number: int, material: str, density: float) -> dict[str, Any]:
    rest = np.zeros((1, 3))
    one, members = placed(template, number, density, rest, rest, rest, None, None)
    fit = template.fit
    return {
        "name": template.name,
        "material": material,
        "members": len(template.radius),
        "least_radius": float(template.radius.min()),
        "greatest_radius": float(template.radius.max()),
        "volume": template.volume,
        "mass": float(one.mass[0]),
        "moments": one.moments[0].tolist(),
        "revolution": bool(template.moments[0] == template.moments[1]),
        "least_mass": float(one.least_mass(members[1]).min()),
        "coverage": fit.coverage if fit is not None else None,
        "mean_deviation": fit.mean_deviation if fit is not None else None,
        "deviation": fit.deviation if fit is not None else None,
    }


def clump_lines(rows: Sequence[dict[str, Any]]) -> Iterator[str]:
    """The rows for people."""
    for row in rows:
        moments = ", ".join(f"{moment:.4g}" for moment in row["moments"])
        turning = "; a body of revolution: its rotation is exact at any step" if row["revolution"] else ""
        yield (
            f"clump {row['name']} of {row['material']}: {row['members']} spheres of {row['least_radius']:.3g} to "
            f"{row['greatest_radius']:.3g} m, volume {row['volume']:.4g} m3, mass {row['mass']:.4g} kg, moments {moments} kg m2"
            f"{turning}; the time step goes by {row['least_mass']:.3g} kg, which a force on one of its spheres meets at least"
        )
        if row["coverage"] is not None:
            yield (
                f"  fitted: covers {100.0 * row['coverage']:.3g} % of its mesh, whose surface is {row['mean_deviation']:.2g} m "
                f"from that of the spheres in the mean, {row['deviation']:.2g} m at most"
            )
