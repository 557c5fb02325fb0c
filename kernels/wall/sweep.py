"""The wall contacts of a CPU core: contact points of several grains in the lanes of its registers.

Which contact points there are is searched grain by grain (``evaluate.search``), with branches that differ from grain to grain;
the law is that of ``contact``, translated by ``simd.translate``. Written here in C++ is only how numbers come in and go out. A
grain's contact points are added up in their order, so its load has the bits of the plain loop.
"""

import functools

import warp as wp
from warpdem.kernels.simd import rows
from warpdem.kernels.simd.lane_types import declarations
from warpdem.kernels.simd.rows import gathered, same
from warpdem.kernels.simd.translate import Translator
from warpdem.kernels.step.schedule import Placement, Row
from warpdem.kernels.step.structs import ForceCall, Range
from warpdem.kernels.wall.contact_points import Hit
from warpdem.kernels.wall.mobility import Mobility
from warpdem.kernels.wall.record import FOUND, FRICTION

BLOCK = 64  # grains searched before their contact points are evaluated, while what the search has read is in the caches


@functools.cache
def source(one, lanes: int, table: bool) -> str:
    """C++ of the sweep; arguments as in ``build``.

    Raises:
        NotStraight: the law cannot be evaluated in lanes; the message says where.
    """
    law = Translator()
    contact = law.add(one.contact).name
    memory, result, entry = one.WallHistory._length_, one.Result._length_, one.WallEntry._length_
    indices = "".join(f"            {name}_of[k] = wall_contacts.found.data[at].c[{FOUND.of(name)}];\n" for name in FOUND.names)
    placement = "wp::address(placements, call.{}, 0)->c".format
    c_of_all = "" if table else same("c", one.Coefficients, "model.coefficients.data[0].c")
    c_of_each = gathered("c", one.Coefficients, "model.coefficients.data[0].c", "coefficients_of", lanes) if table else ""
    then = gathered("then", Placement, placement("before"), "motion_of", lanes) if one.looks_back else ""
    mobility = f"        wp::vec_t<{Mobility._length_}, f64> mobility;\n"  # read by nobody where no wall is free
    if one.yielding:
        mobility = gathered("mobility", Mobility, "model.surface.mobility.data[0].c", "motion_of", lanes)
    given = [
        ("wp::address(wall_contacts.point, call.new_generation, slot_of[k])->c", [f"o.r0.c[{f}]" for f in range(memory)]),
        ("wall_contacts.result.data[slot_of[k]].c", ["feature", *(f"o.r1.c[{f}]" for f in range(3)),
                                       *(f"o.r2.c[{f}]" for f in range(result - FRICTION))]),
        ("loads[k]", [f"o.r1.c[{f}]" for f in range(6)]),
    ]  # fmt: skip
    sums = "            for (int f = 0; f < 6; ++f) wall_contacts.load.data[grain_of[k]].c[f] += loads[k][f];\n"
    if one.has_parts:
        given.append(("entries[k]", [f"o.r5.c[{f}]" for f in range(entry)]))
        sums += f"            for (int f = 0; f < {entry}; ++f) wall_contacts.entry.data[grain_of[k]].c[f] += entries[k][f];\n"
        sums += "            *wp::address(wall_contacts.power, grain_of[k], wall_of[k]) += o.r6[k];\n"
    return f"""{declarations(lanes)}
    struct batch {{
        enum {{ LANES = {lanes} }};
{rows.helpers(wp.float64, lanes)}{law.text}    }};
{same("step", Row, "row.c")}{c_of_all}    f64 deepest = extreme.data[to], fastest = extreme.data[to + 1];
    for (wp::int32 e = first; e < last; e += {lanes}) {{
        const wp::int32 count = last - e < {lanes} ? last - e : {lanes};
        wp::int32 {", ".join(f"{name}_of[{lanes}]" for name in FOUND.names)};
        f64 known, wall, feature;
        for (int k = 0; k < {lanes}; ++k) {{
            const wp::int32 at = k < count ? e + k : last - 1;  // the last once more, where there are no more
{indices}            known[k] = before_of[k] < 0 ? 0.0 : 1.0;
            before_of[k] = before_of[k] < 0 ? slot_of[k] : before_of[k];
            wall[k] = wall_of[k];
            feature[k] = feature_of[k];
        }}
{gathered("state", one.Record, "grains.record.data[0].c", "grain_of", lanes)}\
{gathered("inv", one.Inverse, "grains.inverse.data[0].c", "grain_of", lanes)}\
{gathered("point", Hit, "wall_contacts.hit.data[0].c", "hit_of", lanes)}\
{gathered("before", one.WallHistory, "wp::address(wall_contacts.point, call.old_generation, 0)->c", "before_of", lanes)}\
{gathered("now", Placement, placement("now"), "motion_of", lanes)}{then}{mobility}{c_of_each}\
        const auto o = batch::{contact}(
            state, inv, point, wall, known, before, now, {"then" if one.looks_back else "now"}, mobility, c, step,
            f64(model.dt));
        deepest = deepest < o.r3 ? o.r3 : deepest;
        fastest = fastest < o.r4 ? o.r4 : fastest;
        double loads[{lanes}][6]{f", entries[{lanes}][{entry}]" if one.has_parts else ""};
{rows.write(wp.float64, lanes, "batch", given)}\
        for (int k = 0; k < count; ++k) {{
{sums}        }}
    }}
    for (int k = 0; k < {lanes}; ++k) {{
        extreme.data[to] = wp::max(extreme.data[to], deepest[k]);
        extreme.data[to + 1] = wp::max(extreme.data[to + 1], fastest[k]);
    }}
"""


@functools.cache
def build(structs, one, grains_of_walls, lanes: int, table: bool):
    """Return ``sweep``: evaluates the wall contacts of a range of grains.

    Args:
        structs: namespace of ``step.structs.build``.
        one: namespace of ``contact.build``.
        grains_of_walls: namespace of ``evaluate.build``.
        lanes: contacts side by side, a power of two.
        table: coefficients differ between contacts.

    Raises:
        NotStraight: the law cannot be evaluated in lanes.
    """
    Model, Grains = structs.Model, structs.Grains
    search, WallContacts = grains_of_walls.search, grains_of_walls.WallContacts

    @wp.func_native(source(one, lanes, table))
    def evaluate_found(
        first: int,
        last: int,
        call: ForceCall,
        row: Row,
        placements: wp.array2d(dtype=Placement),
        model: Model,
        grains: Grains,
        wall_contacts: WallContacts,  # written; loads, entries and powers are added to
        extreme: wp.array(dtype=wp.float64),  # from ``to``: largest overlap ratio [-] and approach speed [m/s]
        to: int,
    ):
        """Evaluate contact points ``first`` to ``last`` of those found."""
        ...

    @wp.func
    def sweep(
        part: Range, call: ForceCall, row: Row, placements: wp.array2d(dtype=Placement), model: Model, grains: Grains,
        wall_contacts: WallContacts, extreme: wp.array(dtype=wp.float64),
    ):  # fmt: skip
        """Evaluate a range of the grains that have candidates; arguments as of ``evaluate``."""
        done = int(0)
        if part.first < part.last:
            # from the first slot of its grains on there is room for what a thread finds, apart from the others'
            done = wall_contacts.first[wall_contacts.grain[part.first]]
        end = int(done)
        for block in range(part.first, part.last, part.stride * wp.static(BLOCK)):
            block_end = wp.min(block + part.stride * wp.static(BLOCK), part.last)
            for r in range(block, block_end, part.stride):
                end = search(r, end, call, placements, model, grains, wall_contacts)
            full = int(end)
            if block_end < part.last:  # what fills no register waits for the next block
                full -= (end - done) % wp.static(lanes)
            evaluate_found(done, full, call, row, placements, model, grains, wall_contacts, extreme, part.slot + 2)
            done = full

    return sweep
