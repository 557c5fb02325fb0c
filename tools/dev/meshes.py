"""Makes the meshes of the scenes: `python tools/dev/meshes.py` writes all into scenes/meshes.

    box.stl               closed unit box, corner at the origin, metres; scale it
    hourglass.stl         small hourglass in mean grain diameters: with scale = the mean diameter each bulb holds
                          5 000 grains (diameters 2/3 to 4/3 of the mean) at 65 % filling
    hourglass_paper.stl   hourglass for 160 000 grains of 0.3-0.6 mm, millimetres (scale = 0.001)
    belt.stl              endless belt around two drums, an open sheet without thickness, millimetres; drums along y
    screw.stl             right-handed flight around the x axis, an open sheet, millimetres
    screen.stl            deck of bars along x, each a closed box, millimetres
    ribs.stl              plate of ribs along y, an open sheet, in units of their distance: 8 by 4, half as high; scale it
    hopper.stl            flat-bottomed bin with a round hole over a closed chamber, millimetres; the hole at the origin
    tube.stl              open tube of radius 1 and height 1 around the z axis, a sheet without thickness; scale it

A hourglass of other dimensions: `python tools/dev/meshes.py --out my.stl --neck-radius 2 ...`.
"""

import argparse
import itertools
import math
from pathlib import Path

import numpy as np

MESHES = Path(__file__).resolve().parents[2] / "scenes" / "meshes"
SMALL = {"neck_radius": 4.5, "neck_length": 2.2, "half_angle": 30.0, "rim_radius": 16.2}
PAPER = {"neck_radius": 2.025, "neck_length": 1.0, "half_angle": 30.0, "rim_radius": 23.2}
HOPPER = {"hole_radius": 20.0, "bin_radius": 50.0, "bin_height": 120.0, "chamber_height": 50.0}
BELT = {"distance": 200.0, "radius": 20.0, "width": 40.0, "segments": 20}
SCREW = {"pitch": 40.0, "turns": 3, "inner": 7.5, "outer": 24.0, "segments": 32, "strips": 3}
RIBS = {"ribs": 8, "width": 4.0, "depth": 0.5}
SCREEN = {"length": 150.0, "bars": 8, "pitch": 6.0, "thickness": 2.0, "height": 3.0}


def revolve(radius: np.ndarray, height: np.ndarray, segments: int) -> np.ndarray:
    """Triangles (t, 3, 3) of the closed surface of a profile turned about z, wound outwards.

    Args:
        radius: Radii of the rings; the first and the last are 0 (the surface's ends on the axis).
        height: z of the rings, ascending between the ends.
        segments: Corners of each ring.
    """
    angle = 2.0 * math.pi * np.arange(segments + 1) / segments
    circle = np.stack([np.cos(angle), np.sin(angle)], axis=1)
    circle[-1] = circle[0]  # the seam closes to the last bit
    rings = [np.column_stack([r * circle, np.full(segments + 1, z)]) for r, z in zip(radius, height, strict=True)]
    parts = []
    for lower, upper in itertools.pairwise(rings):
        a, b, c, d = lower[:-1], lower[1:], upper[1:], upper[:-1]
        if lower[0, :2].any():
            parts.append(np.stack([a, b, c], axis=1))
        if upper[0, :2].any():
            parts.append(np.stack([a, c, d], axis=1))
    # where one ring is a point, the triangle left names it once
    return np.concatenate(parts)


def hourglass(
    neck_radius: float, neck_length: float, half_angle: float, rim_radius: float, segments: int = 48, rows: int = 14
) -> np.ndarray:
    """Triangles (t, 3, 3) of two cones joined by a cylindrical neck, flat lids, axis z, neck centre at the origin.

    Args:
        neck_radius: Radius of the neck.
        neck_length: Length of the neck.
        half_angle: Angle between the axis and the cone [deg].
        rim_radius: Radius of the lids.
        segments: Corners of each ring.
        rows: Rows of triangles along each cone, growing with the radius so that triangles keep their shape.
    """
    radius = np.geomspace(neck_radius, rim_radius, rows + 1)
    height = 0.5 * neck_length + (radius - neck_radius) / math.tan(math.radians(half_angle))
    lid = rim_radius * np.array([2.0, 1.0, 0.0]) / 3.0
    radius, height = np.append(radius, lid), np.append(height, np.full(3, height[-1]))
    return revolve(np.append(radius[::-1], radius), np.append(-height[::-1], height), segments)


def hopper(
    hole_radius: float, bin_radius: float, bin_height: float, chamber_height: float, segments: int = 48
) -> np.ndarray:
    """Triangles (t, 3, 3) of a cylindrical bin whose flat floor, in the plane z = 0, has a round hole in its middle.

    Below the hole a cone widens, so that nothing leads the grains beyond the sharp rim; a lid closes it.

    Args:
        hole_radius: Radius of the hole.
        bin_radius: Radius of the bin and of the chamber's lid.
        bin_height: Height of the bin.
        chamber_height: Height of the chamber below the floor.
        segments: Corners of each ring.
    """
    radius = np.array([0.0, 0.5 * bin_radius, bin_radius, hole_radius, bin_radius, bin_radius, 0.5 * bin_radius, 0.0])
    height = np.array([-chamber_height] * 3 + [0.0] * 2 + [bin_height] * 3)
    return revolve(radius, height, segments)


def tube(segments: int) -> np.ndarray:
    """Triangles (t, 3, 3) of an open tube of radius 1 from z = 0 to z = 1.

    Args:
        segments: Corners of each end.
    """
    angle = 2.0 * math.pi * np.arange(segments + 1) / segments
    circle = np.column_stack([np.cos(angle), np.sin(angle), np.zeros(segments + 1)])
    circle[-1] = circle[0]  # the seam closes to the last bit
    return strip(circle, circle + np.array([0.0, 0.0, 1.0]))


def belt(distance: float, radius: float, width: float, segments: int) -> np.ndarray:
    """Triangles (t, 3, 3) of a belt around drums at x = 0 and x = ``distance``, from y = -width/2 to width/2, wound outwards.

    Args:
        distance: Between the axes of the drums.
        radius: Of the belt on the drums.
        width: Along the drums.
        segments: Facets on half a drum.
    """
    angle = math.pi * np.arange(segments + 1) / segments
    head = np.stack([distance + radius * np.sin(angle), radius * np.cos(angle)], axis=1)
    tail = np.stack([-radius * np.sin(angle), -radius * np.cos(angle)], axis=1)
    path = np.concatenate([head, tail, head[:1]])
    near, far = (np.column_stack([path[:, 0], np.full(len(path), y), path[:, 1]]) for y in (-0.5 * width, 0.5 * width))
    return strip(near, far)


def screw(pitch: float, turns: int, inner: float, outer: float, segments: int, strips: int) -> np.ndarray:
    """Triangles (t, 3, 3) of a right-handed helical flight around x, from x = 0 to ``turns`` times ``pitch``.

    Args:
        pitch: Advance per turn.
        turns: Number of turns.
        inner: Inner radius.
        outer: Outer radius.
        segments: Per turn.
        strips: Rows of triangles from the inner to the outer radius.
    """
    turn = np.arange(turns * segments + 1) / segments
    ring = np.stack([np.zeros_like(turn), np.cos(2.0 * math.pi * turn), np.sin(2.0 * math.pi * turn)], axis=1)
    lines = [np.outer(pitch * turn, [1.0, 0.0, 0.0]) + r * ring for r in np.linspace(inner, outer, strips + 1)]
    return np.concatenate([strip(a, b) for a, b in itertools.pairwise(lines)])


def strip(first: np.ndarray, second: np.ndarray) -> np.ndarray:
    """Triangles (2 n, 3, 3) between two lines of n + 1 points."""
    a, b, c, d = first[:-1], first[1:], second[1:], second[:-1]
    return np.concatenate([np.stack([a, b, c], axis=1), np.stack([a, c, d], axis=1)])


def ribs(ribs: int, width: float, depth: float) -> np.ndarray:
    """Triangles (t, 3, 3) of a sheet folded into ribs along y a unit apart, their edges at z = 0, upper sides towards +z.

    Args:
        ribs: Number of ribs, from x = 0 on.
        width: Length of the ribs.
        depth: Height of an edge above the grooves.
    """
    x = 0.5 * np.arange(2 * ribs + 1)
    z = np.where(np.arange(2 * ribs + 1) % 2, 0.0, -depth)
    near, far = (np.column_stack([x, np.full_like(x, y), z]) for y in (0.0, width))
    a, b, c, d = near[:-1], near[1:], far[1:], far[:-1]
    return np.concatenate([np.stack([a, b, c], axis=1), np.stack([a, c, d], axis=1)])


def screen(length: float, bars: int, pitch: float, thickness: float, height: float) -> np.ndarray:
    """Triangles (t, 3, 3) of bars from x = 0 to ``length`` below z = 0, the second of them at y = 0, closed boxes.

    Args:
        length: Of the bars.
        bars: Number of bars.
        pitch: Between two of them.
        thickness: Of a bar along y.
        height: Of a bar along z.
    """
    places = [[0.0, (k - 1) * pitch - 0.5 * thickness, -height] for k in range(bars)]
    return np.concatenate([unit_box() * [length, thickness, height] + place for place in places])


def unit_box() -> np.ndarray:
    """Twelve triangles (12, 3, 3) of the box from (0, 0, 0) to (1, 1, 1), wound outwards."""
    faces = []
    for axis in range(3):
        corners = np.array([[0.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 1.0, 1.0], [0.0, 0.0, 1.0]])
        square = np.roll(corners, axis, axis=1)
        low = square[::-1]
        high = square + np.roll([1.0, 0.0, 0.0], axis)
        for side in (low, high):
            faces += [side[[0, 1, 2]], side[[0, 2, 3]]]
    return np.array(faces)


def check(triangles: np.ndarray) -> float:
    """Enclosed volume of the mesh as it is in the file (float32).

    Raises:
        ValueError: Some edge is not run through exactly once in each direction, or the normals point inwards.
    """
    corners = triangles.astype(np.float32).astype(float)
    _, number = np.unique(corners.reshape(-1, 3), axis=0, return_inverse=True)
    number = number.reshape(-1, 3)
    edges = np.stack([number, np.roll(number, -1, axis=1)], axis=2).reshape(-1, 2)
    there = np.unique(edges, axis=0)
    back = np.unique(edges[:, ::-1], axis=0)
    if len(there) != len(edges) or not np.array_equal(there, back):
        raise ValueError("the mesh is not closed")
    volume = float(np.linalg.det(corners).sum() / 6.0)
    if volume <= 0.0:
        raise ValueError(f"the normals point inwards: volume {volume}")
    return volume


def write_stl(path: Path, triangles: np.ndarray) -> None:
    """Write triangles (t, 3, 3) as binary STL."""
    normal = np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])
    record = np.zeros(len(triangles), dtype=[("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attribute", "<u2")])
    record["normal"] = normal / np.linalg.norm(normal, axis=1)[:, None]
    record["corners"] = triangles
    # scenes know a mesh by the digest of its file, so the header keeps the name this tool had when they were written
    header = b"warpdem tools/make_meshes.py".ljust(80, b" ")
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_bytes(header + np.uint32(len(triangles)).tobytes() + record.tobytes())


def make(path: Path, triangles: np.ndarray, sheet: bool = False) -> None:
    """Check, write and report one mesh; a ``sheet`` is open and has no volume."""
    volume = 0.0 if sheet else check(triangles)
    write_stl(path, triangles)
    size = np.ptp(triangles.reshape(-1, 3), axis=0)
    kind = "open" if sheet else "closed"
    print(
        f"{path.name}: {len(triangles)} triangles, {kind}, size {size[0]:.6g} x {size[1]:.6g} x {size[2]:.6g}, "
        f"volume {volume:.8g}, {path.stat().st_size / 1000:.0f} kB"
    )


def main() -> None:
    """Write the meshes of the scenes, or one hourglass."""
    parser = argparse.ArgumentParser(description="Makes the meshes of the scenes, or one hourglass of your own.")
    parser.add_argument("--out", type=Path, help="write one hourglass of the dimensions below to this file")
    for name, unit in (("neck-radius", ""), ("neck-length", ""), ("half-angle", " [deg]"), ("rim-radius", "")):
        default = SMALL[name.replace("-", "_")]
        parser.add_argument(f"--{name}", type=float, default=default, help=f"{default:g}{unit} if not given")
    parser.add_argument("--segments", type=int, default=48, help="corners of each ring")
    parser.add_argument("--rows", type=int, default=14, help="rows of triangles along each cone")
    options = vars(parser.parse_args())
    out = options.pop("out")
    if out is not None:
        make(out, hourglass(**options))
        return
    make(MESHES / "box.stl", unit_box())
    make(MESHES / "hourglass.stl", hourglass(**SMALL))
    make(MESHES / "hourglass_paper.stl", hourglass(**PAPER))
    make(MESHES / "hopper.stl", hopper(**HOPPER))
    make(MESHES / "belt.stl", belt(**BELT), sheet=True)
    make(MESHES / "screw.stl", screw(**SCREW), sheet=True)
    make(MESHES / "tube.stl", tube(24), sheet=True)
    make(MESHES / "screen.stl", screen(**SCREEN))
    make(MESHES / "ribs.stl", ribs(**RIBS), sheet=True)


if __name__ == "__main__":
    main()
