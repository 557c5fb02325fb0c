"""What the test file of a normal law states of its keys of ``[[pairs]]``: tests of all laws need no list of their own."""

import ast
from pathlib import Path

NORMAL = Path(__file__).parents[1] / "kernels" / "normal"


def in_a_bed(law: str) -> dict | None:
    """Keys of the pair of materials of a normal law, ``BED = {...}`` in its test file; None if it states none."""
    assigned = [node for node in ast.parse((NORMAL / f"test_{law}.py").read_text()).body if isinstance(node, ast.Assign)]
    given = [node.value for node in assigned if [getattr(target, "id", "") for target in node.targets] == ["BED"]]
    return ast.literal_eval(given[0]) if given else None
