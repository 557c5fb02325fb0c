"""The clumps of a CPU core: the step of several of them in the lanes of its registers.

The step of a clump is that of ``clumps``, translated by ``simd.translate``, so a clump has the bits that it has by itself.
Written here in C++ is only how numbers come in and go out: in the lane of a clump that has fewer members than another, or where
there are no more clumps, the last one is done once more. Loads of members are summed one by one, as of any grain. What is
written later is announced while they are summed, and the forces on the next clumps while members are written: in a large bed
all of it comes from beyond the caches.

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
from warpdem.kernels.step.motion_sweep import strayed
from warpdem.kernels.step.schedule import Row


def _loads(real, lanes: int, walls: bool) -> str:
    """C++ of ``at`` and ``load``: the n-th member of each clump and what acts on it, nothing where there is none.

    The sums of ``motion.build_load``, which stay in registers on their way into lanes.
    """
    number = NUMBER[real]
    at_walls = """
                if (wall_contacts.candidates.data[m] > 0) {
                    const double* one = wall_load.data[m].c;
                    force[k] += *(const given4*)one;
                    torque[k] += *(const given2*)(one + 4);
                }"""
    squares = ""
    for first in range(0, 6, lanes):
        columns = range(first, min(first + lanes, 6))
        rows_of = "".join(
            f" r[k][{f - first}] = {f'force[k][{f}]' if f < 4 else f'torque[k][{f - 4}]'};" for f in columns
        )
        squares += f"""            {{
                f64 r[{lanes}] = {{}};
                #pragma unroll
                for (int k = 0; k < {lanes}; ++k) {{{rows_of} }}
                batch::transpose(r);
{"".join(f"                load.c[{f}] = r[{f - first}];" + chr(10) for f in columns)}\
            }}
"""
    return f"""\
            sum4 force[{lanes}] = {{}};
            sum2 torque[{lanes}] = {{}};
            #pragma unroll
            for (int k = 0; k < {lanes}; ++k) {{
                const wp::int32 m = at[k] = first[k] + (n < count[k] ? n : count[k] - 1);
                const wp::int32* slot = grains.slot_start.data + m;
                __builtin_prefetch(grains.record.data + m, 1);
                __builtin_prefetch((const char*)(grains.record.data + m) + 64, 1);
                __builtin_prefetch(grains.inverse.data + m, 1);
                __builtin_prefetch(wp::address(grains.reference, m, 0));
                if (n >= count[k]) continue;
                #pragma clang loop unroll(disable)
                for (wp::int32 e = slot[0]; e < slot[1]; ++e) {{
                    const {number}* one = slot_force.data[e].c;
                    force[k] += __builtin_convertvector(*(const stored4*)one, sum4);
                    torque[k] += __builtin_convertvector(*(const stored2*)(one + 4), sum2);
                }}{at_walls if walls else ""}
            }}
{squares}"""


def source(clumps, travel, lanes: int, *, real, walls: bool, leave: bool, driven: bool) -> str:
    """C++ of the sweep; arguments as in ``build``."""
    law, number = Translator(), NUMBER[real]
    of = clumps.of_numbers
    functions = (rotation_matrix, with_member, what_drives, of.moved, of.inside, of.body_of, of.member_of)
    axes_of_clump, loaded, drives, moved, inside, body_of, member_of = (law.add(function).name for function in functions)
    Record = grain.build(True).Record
    width = Record._length_
    there = f"clumps.record.data[c].c[0] != {grain.REMOVED_X!r}" if leave else "true"
    summed = f"""
        wp::vec_t<6, f64> total;
        const auto axes = batch::{axes_of_clump}(turn);
        for (wp::int32 n = 0; n < most; ++n) {{
            wp::int32 at[{lanes}];
            wp::vec_t<6, f64> load;
{_loads(real, lanes, walls)}\
{gathered("arm", wp.vec4d, "clumps.arm.data[0].c", "at", lanes)}\
            total = batch::{loaded}(total, axes, arm, load);
        }}
        const auto drive = batch::{drives}(total, rate, step);
"""
    next_forces = f"""\
                const wp::int32 ahead = at[k] + most * {lanes} < members ? at[k] + most * {lanes} : members - 1;
                const char* force = (const char*)(slot_force.data + grains.slot_start.data[ahead]);
                __builtin_prefetch(force);
                __builtin_prefetch(force + 64);
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
    const auto& slot_force = grains.slot_force;
    const auto& wall_load = wall_contacts.load;
    const wp::int32 members = grains.record.shape[0];
    typedef {number} stored4 __attribute__((ext_vector_type(4), aligned(sizeof({number})), may_alias));
    typedef {number} stored2 __attribute__((ext_vector_type(2), aligned(sizeof({number})), may_alias));
    typedef double given4 __attribute__((ext_vector_type(4), aligned(sizeof(double)), may_alias));
    typedef double given2 __attribute__((ext_vector_type(2), aligned(sizeof(double)), may_alias));
    typedef double sum4 __attribute__((ext_vector_type(4)));
    typedef double sum2 __attribute__((ext_vector_type(2)));
{same("step", Row, "step_row.c")}    bool strayed = {"false" if check else "true"};
    for (wp::int32 c = begin; c < end;) {{
        wp::int32 of[{lanes}], first[{lanes}], count[{lanes}], most = 0, lane = 0;
        for (; lane < {lanes} && c < end; ++c)
            if ({there}) of[lane++] = c;
        if (lane == 0) break;
        for (; lane < {lanes}; ++lane) of[lane] = of[lane - 1];
        for (int k = 0; k < {lanes}; ++k) {{
            first[k] = clumps.first.data[of[k]];
            count[k] = clumps.count.data[of[k]];
            most = most < count[k] ? count[k] : most;
        }}
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
            wp::int32 at[{lanes}];
            for (int k = 0; k < {lanes}; ++k) {{
                at[k] = first[k] + (n < count[k] ? n : count[k] - 1);
{"" if driven else next_forces}\
            }}
{gathered("arm", wp.vec4d, "clumps.arm.data[0].c", "at", lanes)}\
            const auto w = batch::{member_of}(body, arm, f64(dt));
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
