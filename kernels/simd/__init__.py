"""SIMD on a CPU: what is done to one contact, done to ``lanes`` of them in the lanes of a register.

    lane_types    C++ types whose numbers are registers, and what Warp's types become
    translate     C++ over such types from straight-line Warp functions: the same operations in the same order
    statements    of a function, as assignments in the lanes that take part
    expressions   values of what the source says; what is known now is evaluated
    operations    arithmetic, comparisons, choices, types and builtin functions of values
    values        expressions in C++ with their types
    rows          numbers that lie in rows of memory (of a grain, of a force slot) to and from registers

A law is written once, as Warp functions of one contact. Warp's own C++ templates (``wp::vec_t<3, T>``, ``wp::dot``) take any T
that adds and multiplies, so a translated function says line for line what Warp's compiler would have said, with T a register
instead of a number. IEEE operations give a number the same bits in any lane, so the bits of a result are those of the Warp
function. What a loop over contacts reads and writes is put together around it (``contact.sweep``).
"""
