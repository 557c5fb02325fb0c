"""Candidates of a CPU core: sorted grains that stand one after the other, tested several at a time in the lanes of registers.

The rule is ``near`` of ``neighbors``, translated by ``simd.translate``; written here in C++ is only how numbers come in, how
those that are near are kept, and how a row is put in order. A tenth of the candidates are near, and no processor can foresee
which. So nothing branches on it: what is near in a register is written behind those that were found, in one store, or where
there is no instruction for that, each is written and counted only if it is near. As little can be foreseen of the order of a
row: the place of each partner is how many come before it, which registers count.
"""

import functools

import warp as wp
from warpdem.kernels import KernelSet
from warpdem.kernels.lists.cells import COPIED, SPARE, SizeGrids
from warpdem.kernels.simd.lane_types import declarations
from warpdem.kernels.simd.rows import same
from warpdem.kernels.simd.translate import Translator

LANES = SPARE  # candidates side by side: eight doubles fill a register of AVX-512; others take several instructions for one
ROOM = 64  # grains that are found before they are added to a row
Found = wp.types.vector(ROOM + LANES, wp.int32)


def collecting(near, packed: bool) -> str:
    """C++ of ``collect``; arguments as of ``build``."""
    law = Translator()
    name = law.add(near).name
    column = "*(const part*)(grids.copies.data + {} * grids.copies.shape[1] + e)".format
    place, radius, allowed = "there", *(column(c) for c in range(3, COPIED))
    return f"""{declarations(LANES)}
    typedef bool bits __attribute__((ext_vector_type({LANES})));
    typedef double part __attribute__((ext_vector_type({LANES}), aligned(sizeof(double))));
    typedef wp::int32 numbers __attribute__((ext_vector_type({LANES}), aligned(sizeof(wp::int32)), may_alias));
    struct batch {{
        enum {{ LANES = {LANES} }};
{law.text}    }};
{same("seen_from", wp.vec3d, "place.c")}{same("at", wp.vec3d, "home.c")}\
    wp::int32 n = kept, e = begin;
    for (; e < end && n <= {ROOM}; e += {LANES}) {{
        wp::vec_t<3, f64> there;
{"".join(f"        there.c[{c}] = {column(c)};" + chr(10) for c in range(3))}\
        const f64 is_near = batch::{name}(seen_from, at, f64(radius), f64(allowance), {place}, {radius}, {allowed});
        unsigned mask = __builtin_bit_cast(unsigned char, __builtin_convertvector(is_near != f64(0.0), bits));
        if (end - e < {LANES}) mask &= (1u << (end - e)) - 1u;
        const wp::int32* const grain = grids.grain.data + e;
#if defined(__AVX512VL__) && {int(packed)}
        *(numbers*)(found.c + n) = __builtin_ia32_compresssi256_mask(*(const numbers*)grain, numbers(0), mask);
        n += __builtin_popcount(mask);
#else
        for (int k = 0; k < {LANES}; ++k) {{
            found.c[n] = grain[k];
            n += mask >> k & 1;
        }}
#endif
    }}
    kept = n;
    return e < end ? e : end;
"""


WRITING = f"""\
    typedef wp::int64 ids __attribute__((ext_vector_type({LANES}), aligned(sizeof(wp::int64))));
    const ids lane = {{{", ".join(map(str, range(LANES)))}}};
    wp::int64 key[{ROOM + LANES}], before[{ROOM + LANES}];
    for (int k = 0; k < count; ++k) key[k] = id.data[found.c[k]];
    for (int p = 0; p < count; p += {LANES}) {{
        const ids other = *(const ids*)(key + p);
        ids less = 0;
        for (int k = 0; k < count; ++k) {{
            const ids one = key[k];  // a grain that is found twice has two places
            less -= (ids)((one < other) | ((one == other) & (ids(k) < lane + p)));
        }}
        *(ids*)(before + p) = less;
    }}
    for (int k = 0; k < count; ++k) slot_out.data[at + before[k]] = found.c[k];
"""


@functools.cache
def build(near, packed: bool = True):
    """Return ``collect`` and ``write``.

    Args:
        near: of ``neighbors.build``.
        packed: take the instruction that packs lanes, where the processor has it.
    """

    @wp.func_native(collecting(near, packed))
    def collect(
        begin: int, end: int, place: wp.vec3d, radius: wp.float64, allowance: wp.float64, home: wp.vec3d, grids: SizeGrids,
        found: wp.ref[Found], kept: wp.ref[wp.int32],
    ) -> int:  # fmt: skip
        """Put those of the sorted grains ``begin`` to ``end`` that are near behind the ``kept`` that were found.

        Once there are more than ``ROOM`` it stops; returned is the first grain that was not tested.
        """
        ...

    @wp.func_native(WRITING)
    def write(
        found: wp.ref[Found], count: int, id: wp.array(dtype=wp.int64), at: int, slot_out: wp.array(dtype=wp.int32)
    ):  # fmt: skip
        """Write the first ``count`` that were found to the row at ``at``, in order of id."""
        ...

    return KernelSet(collect=collect, write=write)
