"""Extension of griffe for `docs.py`: what a pydantic model assigns without an annotation is no field of it.

griffe-pydantic takes validators that are assigned to a name, and ``__hash__``, for fields, and cannot show them.
"""

from typing import Any

import griffe


class AnnotatedFields(griffe.Extension):
    """Takes the label of a field off such names; it comes after griffe-pydantic."""

    def on_package(self, *, pkg: griffe.Module, **_: Any) -> None:
        """See all classes of the package."""
        self._visit(pkg)

    def _visit(self, thing: griffe.Module | griffe.Class) -> None:
        for member in thing.members.values():
            if isinstance(member, (griffe.Module, griffe.Class)):
                self._visit(member)
            elif isinstance(member, griffe.Attribute) and member.annotation is None:
                member.labels.discard("pydantic-field")
