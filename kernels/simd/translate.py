"""C++ for lanes of contacts from the Warp functions of one contact.

    vector - normal * wp.dot(vector, normal)      wp::sub(vector_, wp::mul(normal_, wp::dot(vector_, normal_)))
    a / real(2.0) if x < y else real(0.0)         ((x_ < y_) ? (a_ / f64(2.0)) : f64(0.0))

Everything that does not depend on a contact is evaluated now: ``wp.static``, names of the function's surroundings, loops over
a known range, an ``if`` on a known value. An ``if`` on data becomes assignments that only its lanes take part in. Functions of
a number that are no machine instruction (``wp.exp``) are called lane by lane. A native function may give its own C++ in lanes
(``values.in_lanes``).

Refused, with file and line (``NotStraight``): loops over data, ``while``, return before the end, arrays, structs, integers
that depend on data, indices that do, numbers without a type beside float64.
"""

from typing import Any

from warpdem.kernels.simd.lane_types import INLINE, Kind
from warpdem.kernels.simd.statements import Source
from warpdem.kernels.simd.values import Function


class Translator:
    """Warp functions and all that they call in C++, each once.

    ``text`` holds them as static members, to be put into a struct behind ``lane_types.declarations``.
    """

    def __init__(self, lanes: str = "LANES") -> None:
        """``lanes``: the number of lanes, in C++."""
        self.text = ""
        self._lanes = lanes
        self._functions: dict[Any, Function] = {}
        self._helpers: set[str] = set()
        self._count = 0

    def add(self, function: Any) -> Function:
        """Translate a Warp function, unless it has been.

        Raises:
            NotStraight: it, or one that it calls, cannot be translated.
        """
        if function not in self._functions:
            self._count += 1
            name = f"{getattr(getattr(function, 'func', None), '__name__', 'function')}_{self._count}"
            native = hasattr(function, "in_lanes")
            self._functions[function] = self._native(function, name) if native else Source(self, function, name).translated()
        return self._functions[function]

    def _native(self, function: Any, name: str) -> Function:
        """A function that says itself what it is in lanes (``values.in_lanes``)."""
        real, body = function.in_lanes
        number, names = Kind(real), list(function.input_types)
        head = ", ".join(f"{number.text} {argument}_" for argument in names)
        self.put(f"        {INLINE} {number.text} {name}({head}) {{{body}        }}\n")
        return Function(name, (number,) * len(names), number)

    def put(self, text: str) -> None:
        """Add the text of a member."""
        self.text += text

    def helper(self, name: str, text: str) -> str:
        """The name of a helper, which is added if it was not yet."""
        if name not in self._helpers:
            self._helpers.add(name)
            self.put(text)
        return name

    def lane_by_lane(self, key: str, lane: str, count: int) -> str:
        """Name of a builtin of Warp applied to each lane of ``count`` arguments."""
        name, letters = f"each_{key}_{lane}", "abcd"[:count]
        arguments, lanes = (", ".join(form.format(a) for a in letters) for form in (f"{lane} {{}}", "{}[k]"))
        body = f"for (int k = 0; k < {self._lanes}; ++k) a[k] = wp::{key}({lanes}); return a;"
        return self.helper(name, f"        {INLINE} {lane} {name}({arguments}) {{ {body} }}\n")

    def extreme(self, key: str, lane: str) -> str:
        """Name of Warp's min or max: of two numbers one of which is none, the other."""
        name, relation = f"{key}_{lane}", {"min": "<=", "max": ">="}[key]
        body = f"return (a {relation} b) ? a : ((b == b) ? b : a);"
        return self.helper(name, f"        {INLINE} {lane} {name}({lane} a, {lane} b) {{ {body} }}\n")
