"""The motion of a CPU core: the step of several grains in the lanes of its registers.

Kick and drift are those of ``exact_drift``, translated by ``simd.translate``, so a grain has the bits that it has by itself.
Written here in C++ is only how numbers come in and go out; forces are summed grain by grain, each in the order of its slots. In
lanes for which there are no more grains the last one is moved once more.
"""

import functools

import warp as wp
from warpdem.kernels import grain
from warpdem.kernels.contact.pairs import force_width
from warpdem.kernels.simd import rows
from warpdem.kernels.simd.lane_types import NUMBER, declarations
from warpdem.kernels.simd.rows import gathered, same
from warpdem.kernels.simd.translate import Translator
from warpdem.kernels.step.motion import by_contacts
from warpdem.kernels.step.schedule import Row

BLOCK = 64  # grains or clumps between two looks at whether one has moved too far
SLOTS = 6  # force slots that are added without a branch: most grains have no more
vec6 = wp.types.vector(6, wp.float64)


@functools.cache
def build_moved(drift, border, *, spins: bool):
    """Return ``moved``, the step of a grain as a function of numbers alone; ``drift`` of ``exact_drift.build_drift``."""
    g = grain.build(spins)

    @wp.func
    def moved(state: g.Record, total: vec6, inverse: wp.vec2d, row: Row, dt: wp.float64) -> g.Record:
        """Record of a grain at the end of a step; its load [N, N m] and inverse mass [1/kg] and inertia [1/(kg m2)]."""
        torque = wp.vec3d(total[3], total[4], total[5])
        out = drift(state, by_contacts(total, inverse[0], row), torque * inverse[1], row, dt)
        if wp.static(border.images > 1):
            out = g.placed(out, border.wrapped(g.position(out)))
        return out

    return moved


def loads(name: str, real, lanes: int, *, spins: bool, walls: bool, slots: int) -> str:
    """C++ of the vector ``name``: the load on each of the grains ``at[k]``, as of ``motion.build_load``.

    A processor cannot foresee how many force slots a grain has. So the first ``slots`` are added without a branch, a row of
    zeros in place of those that it has not: a sum that begins with 0 is never -0, and adding 0 changes none of its bits. A
    row is read in one register, with some of the next row's numbers behind its own; the last slot belongs to no grain.
    """
    number, width = NUMBER[real], force_width(spins)
    whole = 8 if spins else 4  # numbers of the register
    parts = [(0, 4), (4, 2)] if spins else [(0, 2), (2, 1)]  # of a load at walls, of which there may be no next
    at_walls = types = squares = ""
    if walls:
        for n, (first, count) in enumerate(parts):
            kept = f"ext_vector_type({count}), aligned(sizeof(double)), may_alias"
            types += f"    typedef double part{n} __attribute__(({kept}));\n"
            numbers = "".join(f"            beside[{first + c}] = from{n}[{c}];\n" for c in range(count))
            at_walls += f"            const part{n} from{n} = *(const part{n}*)(wall + {first});\n{numbers}"
        at_walls = f"""\
            const double* wall = wall_contacts.candidates.data[at[k]] > 0 ? wall_contacts.load.data[at[k]].c : no_load;
            sum beside = 0.0;
{at_walls}            sums[k] += beside;
"""
    for first in range(0, width, lanes):
        picked = ", ".join(str(n) if n < width else "-1" for n in range(first, first + lanes))
        squares += f"        for (int k = 0; k < {lanes}; ++k) r[k] = __builtin_shufflevector(sums[k], sums[k], {picked});\n"
        squares += "        batch::transpose(r);\n"
        squares += "".join(f"        {name}.c[{f}] = r[{f - first}];\n" for f in range(first, min(first + lanes, width)))
    return f"""\
    typedef {number} stored __attribute__((ext_vector_type({whole}), aligned(sizeof({number})), may_alias));
    typedef double sum __attribute__((ext_vector_type({whole})));
{types}        sum sums[{lanes}];
        f64 r[{lanes}];
        wp::vec_t<6, f64> {name};
        #pragma unroll
        for (int k = 0; k < {lanes}; ++k) {{
            const wp::int32* slot = grains.slot_start.data + at[k];
            const {number}* force = grains.slot_force.data[slot[0]].c;
            const wp::int32 count = slot[1] - slot[0];
            sums[k] = 0.0;
            #pragma unroll
            for (int e = 0; e < {slots}; ++e) {{
                const {number}* one = e < count ? force + e * {width} : no_force;
                sums[k] += __builtin_convertvector(*(const stored*)one, sum);
            }}
            for (wp::int32 e = {slots}; e < count; ++e)
                sums[k] += __builtin_convertvector(*(const stored*)(force + e * {width}), sum);
{at_walls}        }}
{squares}"""


def strayed(distance: str, record: str, lanes: int) -> str:
    """C++ that sets ``strayed`` where the grain ``at[k]`` is further from its reference than it may be, or its place is NaN.

    Args:
        distance: name of the translated ``squared_distance`` of ``motion.build_travel``.
        record: of the grains, in registers.
        lanes: how many grains.
    """
    one = f"for (int k = 0; k < {lanes}; ++k) for (int f = 0; f < 3; ++f) from[f][k] = reference[3ll * at[k] + f];"
    several = {4: "batch::read(reference, 3, at, from);", 8: "batch::read_half(reference, 3, at, from);"}.get(lanes, one)
    return f"""\
        const double* const reference = grains.reference.data->c;
        f64 from[4], allowed;
        if (at[{lanes - 1}] + 1 < grains.record.shape[0]) {{  // a number of the next row is read as well
            {several}
        }} else {{
            {one}
        }}
        wp::vec_t<3, f64> place, before;
        for (int f = 0; f < 3; ++f) {{ place.c[f] = {record}.c[f]; before.c[f] = from[f]; }}
        for (int k = 0; k < {lanes}; ++k) allowed[k] = grains.allowance.data[at[k]];
        allowed *= inner_share;
        const f64 square = batch::{distance}(place, before);
        strayed |= __builtin_reduce_or(~(square <= allowed * allowed)) != 0;
"""


def source(moved, travel, lanes: int, *, real, spins: bool, walls: bool, leave: bool) -> str:
    """C++ of the sweep; arguments as in ``build``."""
    law = Translator()
    step = law.add(moved).name
    Record = grain.build(spins).Record
    out = [("grains.record.data[at[k]].c", [f"o.c[{f}]" for f in range(Record._length_)])]
    there = f"if (grains.record.data[i].c[0] != {grain.REMOVED_X!r}) " if leave else ""
    check = ""
    if travel.in_frame_alone:
        distance = law.add(travel.squared_distance).name
        check = strayed(distance, "o", lanes)
    return f"""{declarations(lanes)}
    struct batch {{
        enum {{ LANES = {lanes} }};
{rows.helpers(wp.float64, lanes)}{law.text}    }};
{same("step", Row, "step_row.c")}    const {NUMBER[real]} no_force[8] = {{}};
    const double no_load[6] = {{}};
    bool strayed = {"false" if check else "true"};
    for (wp::int32 i = begin; i < end;) {{
        wp::int32 at[{lanes}], lane = 0;
        for (; lane < {lanes} && i < end; ++i) {there}at[lane++] = i;
        if (lane == 0) break;
        for (; lane < {lanes}; ++lane) at[lane] = at[lane - 1];
{loads("total", real, lanes, spins=spins, walls=walls, slots=SLOTS)}\
{gathered("state", Record, "grains.record.data[0].c", "at", lanes)}\
{gathered("inverse", wp.vec2d, "grains.inverse.data[0].c", "at", lanes)}\
        const auto o = batch::{step}(state, total, inverse, step, f64(dt));
{rows.write(wp.float64, lanes, "batch", out)}{check}\
    }}
    return strayed ? 1 : 0;
"""


@functools.cache
def build(structs, WallContacts, moved, travel, lanes: int, *, spins: bool, walls: bool, leave: bool):
    """Return ``sweep``: the step of a range of grains.

    Args:
        structs: namespace of ``structs.build``.
        WallContacts: of ``wall.evaluate.build``.
        moved: of ``build_moved``.
        travel: of ``motion.build_travel``.
        lanes: grains side by side, a power of two.
        spins: grains spin.
        walls: there are walls.
        leave: grains may leave the domain; those that have are passed over.
    """
    Grains, real = structs.Grains, structs.PairForce._wp_scalar_type_

    @wp.func_native(source(moved, travel, lanes, real=real, spins=spins, walls=walls, leave=leave))
    def sweep(
        begin: int, end: int, step_row: Row, dt: wp.float64, inner_share: wp.float64, wall_contacts: WallContacts,
        grains: Grains,
    ) -> int:  # fmt: skip
        """Move grains ``begin`` to ``end``; 1 where one of them may have moved too far, else 0."""
        ...

    return sweep
