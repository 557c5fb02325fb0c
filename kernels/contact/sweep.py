"""The contacts of a CPU core: a contact batch in the lanes of its registers.

The law is that of ``pairs.contact``, translated by ``simd.translate``; written here in C++ is only how numbers come in and go
out. Records of ``lanes`` grains are read and transposed, so that a register holds one number of every contact, and the pair
forces are transposed back into the force slots of the grains. Of a batch out of reach only the places are read. Partners lie
too scattered in memory for the hardware to foresee, so a batch is announced some batches ahead.
"""

import functools

import warp as wp
from warpdem.kernels import KernelSet, grain
from warpdem.kernels.contact.columns import Columns
from warpdem.kernels.contact.pairs import EXCHANGE_AT
from warpdem.kernels.measure import window_sum
from warpdem.kernels.simd import rows
from warpdem.kernels.simd.lane_types import INLINE, LANE, NUMBER, declarations
from warpdem.kernels.simd.translate import Translator
from warpdem.kernels.step.structs import SPAN, Range

AHEAD = {4: 6, 8: 4}  # contact batches between the prefetch of a contact batch and its use, by lanes


@functools.cache
def translated(pairs, rotating_frame: bool) -> KernelSet:
    """The functions of one contact in C++, as ``text``, and their names.

    Args:
        pairs: namespace of ``pairs.build``.
        rotating_frame: the axes turn, and the contact history with them.

    Raises:
        NotStraight: the law cannot be evaluated in lanes; the message says where.
    """
    law = Translator()
    functions = {name: getattr(pairs, name) for name in ("contact", "margin", "reduced_radius", "cast_coefficients")}
    if pairs.clumps.there:
        functions["constants_of_clumps"] = pairs.constants_of_clumps
    if pairs.has_parts:
        functions["margin_before"] = pairs.margin_before
    if rotating_frame and pairs.memory.width:
        functions["rotated"] = pairs.memory.rotated
    names = {name: law.add(function).name for name, function in functions.items()}
    return KernelSet(text=law.text, **names)


ARRAYS = {
    "grains.inverse": "inverse", "grains.slot_force": "slot_force", "contacts.owner": "owner",
    "contacts.partner": "partner", "contacts.constants": "constants", "contacts.kind": "kind", "contacts.history": "history_in",
    "contacts.slot_i": "slot_i", "contacts.slot_j": "slot_j", "model.coefficients": "coefficients",
}  # fmt: skip
"""Arrays of the structs under names of their own: what is stored through one of them does not change where others are."""


def source(pairs, lanes: int, *, stored: Columns, rotating_frame: bool, table: bool, ranks: bool = False) -> str:
    """C++ of the sweep; arguments as in ``build``."""
    law, of = translated(pairs, rotating_frame), pairs.law
    real = pairs.real
    lane, number, width = LANE[real], NUMBER[real], grain.WIDTH[pairs.spins]
    remembers, coefficients, own = pairs.memory.width, of.at.width, of.Constants._length_
    near = [at for at in rows.starts(width, lanes) if at < 4]  # parts of the record with position and radius
    far = rows.starts(width, lanes, near[-1] + lanes)
    sides = ("i", "owner"), ("j", "partner")

    def read(parts: list[int]) -> str:
        call = "        batch::read(records + {at}, {width}, {name}.data + p * {lanes}, g{side}.c + {at});\n".format
        return "".join(
            call(at=at, width=width, name=name, lanes=lanes, side=side) for at in parts for side, name in sides
        )

    def lines(form: str, count: int, indent: int = 8) -> str:
        return "".join(f"{indent * ' '}{form.format(f=f)}\n" for f in range(count))

    constant = f"batch::load(constants.data + (p * {stored.width} + {{f}}) * {lanes})"
    radius, inertia = f"__builtin_convertvector(batch::{law.reduced_radius}(gi, gj), {lane})", f"{lane}(0)"
    if "radius" in stored:
        radius, inertia = constant.format(f=stored.radius), constant.format(f=stored.inertia)
    numbers, of_clumps = lines(f"numbers.c[{{f}}] = {constant};", own), ""
    if pairs.clumps.there:  # masses along the normal change as clumps turn: nothing is stored
        of_all = pairs.clumps.Inverse._length_
        of_both = ", ".join(f"{name}.data + p * {lanes}" for _, name in sides)
        numbers = f"        wp::vec_t<{of_all}, f64> inv;\n" + "".join(
            f"        batch::read_sum(inverse.data[0].c + {at}, {of_all}, {of_both}, inv.c + {at});\n"
            for at in rows.starts(of_all, lanes)
        )
        given = f"gi, gj, inv, {radius}, batch::{law.cast_coefficients}(c)"
        of_clumps = f"        numbers = batch::{law.constants_of_clumps}({given});\n"
    history_in, history_out = (f"history_{way}.data + (p * {remembers} + {{f}}) * {lanes}" for way in ("in", "out"))
    rotated = f"        remembered = batch::{law.rotated}(remembered, rotation);\n" if hasattr(law, "rotated") else ""
    chosen = ""
    if table:
        by_kind = f"coefficients.data[kind.data[p * {lanes} + k]].c[f]"
        chosen = f"        for (int k = 0; k < {lanes}; ++k) for (int f = 0; f < {coefficients}; ++f) c.c[f][k] = {by_kind};\n"
    places = [f"slot_{side}.data[p * {lanes} + k]" for side, _ in sides]
    in_reach = f"~(batch::{law.margin}(gi, gj) < f64(0.0))"  # true of what is no number: it must be seen, not passed over
    announced = ["slot_force.data + slot_i.data[k]", "slot_force.data + slot_j.data[k]"]
    zeros = f"slot_force.data[{places[0]}] = slot_force.data[{places[1]}] = {{}};"
    if pairs.has_parts:  # the energy that a contact loses when it opens is found in the step after its last one
        in_reach = f"({in_reach}) | ~(batch::{law.margin_before}(gi, gj, f64(slip_time)) < f64(0.0))"
    if pairs.wet:  # a bridge acts beyond the reach of the law, and breaks there
        bridge = f"batch::load({history_in.format(f=pairs.bridge_at)})"
        in_reach = f"({in_reach}) | __builtin_convertvector({bridge} != {lane}(0), m64)"
    sums, declared, given, added = "", "", "", ""
    if pairs.has_parts:
        columns, digits = pairs.memory.Losses._length_, "wp::address(losses, part.slot / SPAN_, 0, 0)"
        sums = f"""
        typedef wp::int32 whole __attribute__((ext_vector_type({lanes}), aligned(sizeof(wp::int32))));
        {INLINE} f64 numbers(const wp::int32* from) {{ return __builtin_convertvector(*(const whole*)from, f64); }}
{window_sum.lanes(lanes, columns)}"""
        declared = f"""    f64 lost[{3 * columns}] = {{}};
    wp::int64* const digits = {digits.replace("SPAN_", str(SPAN))};
    int added = 0;
"""
        counted = f"(batch::numbers(slot_i.data + p * {lanes}) < f64(slot_force.shape[0] - 1))"
        if ranks:  # a contact across the border of two ranks counts on that of its first grain
            counted += f" & (batch::numbers(owner.data + p * {lanes}) < f64(contacts.owned))"
        added = f"""        f64 value[{columns}];
        const m64 counted = {counted};
        for (int f = 0; f < {columns}; ++f) value[f] = counted ? o.r4.c[f] : f64(0.0);
        batch::add_lost(value, lost, digits);
        if (++added == {window_sum.BATCH}) {{ batch::give_lost(lost, digits); added = 0; }}
"""
        given = "    batch::give_lost(lost, digits);\n"
    prefetch = "".join(f"            __builtin_prefetch({address}, 1);\n" for address in announced)
    if pairs.clumps.there:
        prefetch += "            __builtin_prefetch(inverse.data + partner.data[k]);\n"
    idle = f"""        if (!__builtin_reduce_or({in_reach})) {{  // the law gives zero
            for (int k = 0; k < {lanes}; ++k) {{ {zeros} }}
{lines(f"batch::store({history_out}, {lane}(0));", remembers, 12)}\
            worst = worst < {lane}(0) ? {lane}(0) : worst;
            fastest = fastest < {lane}(0) ? {lane}(0) : fastest;
            continue;
        }}
"""
    records = f"{read(near)}{read(far)}{idle}" if pairs.has_parts else f"{read(near)}{idle}{read(far)}"
    return f"""{declarations(lanes)}
    struct batch {{
        enum {{ LANES = {lanes} }};
{rows.helpers(real, lanes)}{rows.helpers(wp.float64, lanes) if real is not wp.float64 else ""}\
{law.text}{sums}    }};
    const double* const records = grains.record.data[0].c;
{"".join(f"    const auto {name} = {array};" + chr(10) for array, name in ARRAYS.items())}\
    const double dt = model.dt;
    const int at = part.slot, stride = part.stride, last = part.last;
    wp::mat_t<3, 3, {lane}> rotation;
    for (int f = 0; f < 9; ++f) rotation.data[f / 3][f % 3] = axes_rotation.data[f / 3][f % 3];
    wp::vec_t<{coefficients}, f64> c;
    for (int f = 0; f < {coefficients}; ++f) c.c[f] = coefficients.data[0].c[f];
{declared}    {lane} worst = ({number})extreme.data[at], fastest = ({number})extreme.data[at + 1];
    for (long long p = part.first; p < last; p += stride) {{  // products of it are longer than 32 bits
        const long long ahead = p + {AHEAD.get(lanes, 4)} * stride < last ? p + {AHEAD.get(lanes, 4)} * stride : p;
        for (long long k = ahead * {lanes}; k < (ahead + 1) * {lanes}; ++k) {{
            const char* record = (const char*)(grains.record.data + partner.data[k]);
            __builtin_prefetch(record);
            __builtin_prefetch(record + 64);
{prefetch}\
        }}
        wp::vec_t<{width}, f64> gi, gj;
{records}\
        wp::vec_t<{own}, {lane}> numbers;
{numbers}\
        wp::vec_t<{max(remembers, 1)}, {lane}> remembered;
{lines(f"remembered.c[{{f}}] = batch::load({history_in});", remembers)}{rotated}{chosen}{of_clumps}\
        const auto o = batch::{law.contact}(
            gi, gj, numbers, {radius}, {inertia}, batch::{law.cast_coefficients}(c), remembered, f64(slip_time), f64(kick),
            f64(dt));
{lines(f"batch::store({history_out}, o.r1.c[{{f}}]);", remembers)}\
        worst = worst < o.r2 ? o.r2 : worst;
        fastest = fastest < o.r3 ? o.r3 : fastest;
{_given(pairs, lanes, places)}{added}\
    }}
{given}\
    for (int k = 0; k < {lanes}; ++k) {{
        extreme.data[at] = wp::max(extreme.data[at], double(worst[k]));
        extreme.data[at + 1] = wp::max(extreme.data[at + 1], double(fastest[k]));
    }}
"""


def _given(pairs, lanes: int, places: list[str]) -> str:
    """What writes the results to the force slots ``places`` of i and j."""
    at = EXCHANGE_AT
    force = [f"o.r0.c[{at.force + f}]" for f in range(3)]
    on_i, on_j = list(force), [f"wp::neg({text})" for text in force]
    if pairs.spins:
        on_i += [f"o.r0.c[{at.torque_i + f}]" for f in range(3)]
        on_j += [f"o.r0.c[{at.torque_j + f}]" for f in range(3)]
    if pairs.wet:
        on_i += [f"o.r0.c[{at.wish_i}]", f"o.r0.c[{at.gift}]"]
        on_j += [f"o.r0.c[{at.wish_j}]", f"o.r0.c[{at.gift}]"]
    text = rows.write(
        pairs.real, lanes, "batch", [(f"slot_force.data[{k}].c", on) for k, on in zip(places, (on_i, on_j), strict=True)]
    )
    return text


@functools.cache
def build(structs, pairs, lanes: int, *, stored: Columns, rotating_frame: bool, table: bool, ranks: bool = False):
    """Return ``sweep``: evaluates the contact batches of a range.

    Args:
        structs: namespace of ``step.structs.build``.
        pairs: namespace of ``pairs.build``.
        lanes: contacts of a batch: 2, 4 or 8.
        stored: columns of the constants that are kept of each contact.
        rotating_frame: the axes turn, and the contact history with them.
        table: coefficients differ between contacts.
        ranks: some grains belong to other processes.

    Raises:
        NotStraight: the law cannot be evaluated in lanes.
    """
    real = pairs.real

    @wp.func_native(source(pairs, lanes, stored=stored, rotating_frame=rotating_frame, table=table, ranks=ranks))
    def sweep(
        part: Range,
        axes_rotation: pairs.AxesRotation,  # over the last step
        slip_time: wp.float64,
        kick: wp.float64,
        model: structs.Model,
        # read and written: forces
        grains: structs.Grains,
        contacts: structs.ContactBatches,
        # written
        history_out: wp.array3d(dtype=real),  # may be that of ``contacts``
        extreme: wp.array(dtype=wp.float64),  # from the slot of the range: largest overlap ratio [-], approach speed [m/s]
        losses: wp.array3d(dtype=wp.int64),  # of ``Report``; of size 0 unless energies are added up
    ):
        """Evaluate contact batches; what is out of reach gets zeros."""
        ...

    return sweep
