"""The clumps of a CPU core: the step of several of them in the lanes of its registers.

The step of a clump is that of ``clumps``, translated by ``simd.translate``, so a clump has the bits that it has by itself.
Written here in C++ is only how numbers come in and go out: in the lane of a clump that has fewer members than another, or where
there are no more clumps, the last one is done once more. Loads of members are summed one by one, as of any grain. Clumps of one
template and size have the places of their members in common, which then go to all lanes at once. What the next clumps write is
announced while loads are summed, and the forces on them while members are written: in a large bed all of it comes from beyond
the caches, and not in the order of memory.

Nothing but the motion is here: what fields and budgets ask for is done clump by clump, before (``drive``).
"""

import functools

import warp as wp
from warpdem.kernels import grain
from warpdem.kernels.simd import rows
from warpdem.kernels.simd.lane_types import NUMBER, declarations
from warpdem.kernels.simd.rows import gathered, same
from warpdem.kernels.simd.translate import Translator
from warpdem.kernels.step.clumps import what_drives, with_member
from warpdem.kernels.step.free_rotation import rotation_matrix
from warpdem.kernels.step.motion_sweep import loads, strayed
from warpdem.kernels.step.schedule import Row

SLOTS = 4  # force slots that are added without a branch: most members have no more


def source(clumps, travel, lanes: int, *, real, walls: bool, leave: bool, driven: bool) -> str:
    """C++ of the sweep; arguments as in ``build``."""
    law, number = Translator(), NUMBER[real]
    of = clumps.of_numbers
    functions = (rotation_matrix, with_member, what_drives, of.moved, of.inside, of.body_of, of.member_of)
    axes_of_clump, loaded, drives, moved, inside, body_of, member_of = (law.add(function).name for function in functions)
    Record = grain.build(True).Record
    width = Record._length_
    there = f"clumps.record.data[c].c[0] != {grain.REMOVED_X!r}" if leave else "true"
    members = f"""\
            wp::int32 at[{lanes}];
            for (int k = 0; k < {lanes}; ++k) at[k] = first[k] + (n < last[k] ? n : last[k]);
"""
    arm = f"""\
            wp::vec_t<4, f64> arm;
            if (alike) {{
                for (int f = 0; f < 4; ++f) arm.c[f] = clumps.arm.data[shape[0] + n].c[f];
            }} else {{
                wp::int32 row[{lanes}];
                for (int k = 0; k < {lanes}; ++k) row[k] = shape[k] + at[k] - first[k];
{gathered("found", wp.vec4d, "clumps.arm.data[0].c", "row", lanes)}\
                arm = found;
            }}
"""
    next_forces = f"""\
            for (int k = 0; k < {lanes}; ++k) {{
                const wp::int32 next = at[k] + span < grains.record.shape[0] ? at[k] + span : at[k];
                const char* force = (const char*)(grains.slot_force.data + grains.slot_start.data[next]);
                __builtin_prefetch(force);
                __builtin_prefetch(force + 64);
            }}
"""
    summed = f"""
        wp::vec_t<6, f64> total;
        const auto axes = batch::{axes_of_clump}(turn);
        for (wp::int32 n = 0; n < most; ++n) {{
{members}\
            for (int k = 0; k < {lanes}; ++k) {{
                const auto* next = grains.record.data + at[k] + span;
                __builtin_prefetch(next, 1);
                __builtin_prefetch((const char*)next + 64, 1);
                __builtin_prefetch(grains.inverse.data + at[k] + span, 1);
            }}
{loads("load", real, lanes, spins=True, walls=walls, slots=SLOTS)}\
            if (!alike)
                for (int f = 0; f < 6; ++f) load.c[f] = __builtin_convertvector(n <= last, m64) ? load.c[f] : f64(0.0);
{arm}            total = batch::{loaded}(total, axes, arm, load);
        }}
        const auto drive = batch::{drives}(total, rate, step);
"""
    vec6 = wp.types.vector(6, wp.float64)
    given = gathered("drive", vec6, "clumps.drive.data[0].c", "of", lanes)
    clump_out = [
        ("clumps.record.data[of[k]].c", [f"state.c[{f}]" for f in range(width)]),
        ("clumps.turn.data[of[k]].c", [f"o.r1.c[{f}]" for f in range(4)]),
    ]
    member_out = [
        ("grains.record.data[at[k]].c", [f"w.r0.c[{f}]" for f in range(width)]),
        ("(grains.inverse.data[at[k]].c + 2)", [f"w.r1.c[{f}]" for f in range(6)]),
    ]
    check = ""
    if travel.in_frame_alone:
        distance = law.add(travel.squared_distance).name
        check = strayed(distance, "w.r0", lanes)
    return f"""{declarations(lanes)}
    struct batch {{
        enum {{ LANES = {lanes} }};
{rows.helpers(wp.float64, lanes)}{law.text}    }};
    const auto& clumps = grains.clumps;
    typedef wp::int32 whole __attribute__((ext_vector_type({lanes})));
    const {number} no_force[8] = {{}};
    const double no_load[6] = {{}};
{same("step", Row, "step_row.c")}    bool strayed = {"false" if check else "true"};
    for (wp::int32 c = begin; c < end;) {{
        wp::int32 of[{lanes}], most = 0, lane = 0;
        for (; lane < {lanes} && c < end; ++c)
            if ({there}) of[lane++] = c;
        if (lane == 0) break;
        for (; lane < {lanes}; ++lane) of[lane] = of[lane - 1];
        whole first, last, shape;  // member of each clump, the first by its slot, the last by its number
        bool alike = true;
        for (int k = 0; k < {lanes}; ++k) {{
            first[k] = clumps.first.data[of[k]];
            shape[k] = clumps.shape.data[of[k]];
            alike &= shape[k] == shape[0];
            const wp::int32 count = clumps.count.data[of[k]];
            last[k] = count - 1;
            most = most < count ? count : most;
        }}
        const wp::int32 span = first[{lanes - 1}] + last[{lanes - 1}] + 1 - first[0];
{gathered("before", Record, "clumps.record.data[0].c", "of", lanes)}\
{gathered("turn", wp.vec4d, "clumps.turn.data[0].c", "of", lanes)}\
{gathered("rate", wp.vec4d, "clumps.rate.data[0].c", "of", lanes)}\
{given if driven else summed}\
        const auto o = batch::{moved}(before, turn, rate, drive, step, f64(dt));
        const auto state = batch::{inside}(o.r0);
{rows.write(wp.float64, lanes, "batch", clump_out)}\
        for (int k = 0; k < {lanes}; ++k) {{
            const char* next = (const char*)(clumps.record.data + (of[k] + {lanes} < end ? of[k] + {lanes} : of[k]));
            __builtin_prefetch(next, 1);
            __builtin_prefetch(next + 64, 1);
        }}
        const auto body = batch::{body_of}(state, o.r1, o.r2, rate, f64(dt));
        for (wp::int32 n = 0; n < most; ++n) {{
{members}{"" if driven else next_forces}\
{arm}            const auto w = batch::{member_of}(body, arm, f64(dt));
{rows.write(wp.float64, lanes, "batch", member_out)}{check}\
        }}
    }}
    return strayed ? 1 : 0;
"""


@functools.cache
def build(structs, WallContacts, clumps, travel, lanes: int, *, walls: bool, leave: bool, driven: bool):
    """Return ``sweep``: the step of a range of clumps.

    Args:
        structs: namespace of ``structs.build``.
        WallContacts: of ``wall.evaluate.build``.
        clumps: of ``clumps.build``.
        travel: of ``motion.build_travel``.
        lanes: clumps side by side, a power of two.
        walls: there are walls.
        leave: clumps may leave the domain.
        driven: what acts on the clumps has been found before (``drive``).
    """
    Grains = structs.Grains

    real = structs.PairForce._wp_scalar_type_

    @wp.func_native(source(clumps, travel, lanes, real=real, walls=walls, leave=leave, driven=driven))
    def sweep(
        begin: int, end: int, step_row: Row, dt: wp.float64, inner_share: wp.float64, wall_contacts: WallContacts,
        grains: Grains,
    ) -> int:  # fmt: skip
        """Move clumps ``begin`` to ``end`` and write their members; 1 where one of these may have moved too far, else 0."""
        ...

    return sweep
