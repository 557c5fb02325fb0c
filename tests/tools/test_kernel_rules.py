"""The rules of tools/dev/kernel_rules.py are kept, and the checker sees each slip."""

import subprocess
import sys
from pathlib import Path

import pytest

from dev import kernel_rules

TOOL = Path(__file__).resolve().parents[2] / "tools" / "dev" / "kernel_rules.py"


@pytest.fixture
def tool():
    return kernel_rules


def test_kernels_keep_the_rules(tool):
    assert list(tool.KERNELS.rglob("*.py")), "nothing was checked"
    assert tool.check_folder() == []


GOOD = """
import functools
import warp as wp

OPTIONS = {}

@wp.func
def outer(x: wp.float64) -> wp.float64:
    return x

@wp.kernel(enable_backward=False)
def flat(a: wp.array(dtype=wp.float64)):
    a[0] = wp.float64(1.0)

def build(real):
    kernel = functools.partial(wp.kernel, enable_backward=False, module="unique", module_options=OPTIONS)

    @wp.func
    def half(x: real) -> real:
        return real(0.5) * x + wp.static(1.0 / 3.0) + real(wp.static(1.0 / 3.0)) + real(-0.5)

    @kernel
    def run(a: wp.array(dtype=real)):
        a[0] = half(a[0]) + wp.float64(2.0)

    return run
"""


@pytest.mark.parametrize(
    ("old", "new", "what"),
    [
        ("import functools", "from __future__ import annotations", "2: from __future__ import annotations"),
        ("@wp.kernel(enable_backward=False)", "@wp.kernel", "12: kernel flat without enable_backward=False"),
        ("@wp.kernel(enable_backward=False)", "@wp.kernel(enable_backward=True)", "12: kernel flat without"),
        ("wp.kernel, enable_backward=False, ", "wp.kernel, ", "23: kernel run without enable_backward=False"),
        ('module="unique", ', "", '23: nested kernel run without module="unique"'),
        ("    @kernel\n", "    @wp.kernel(enable_backward=False)\n", "nested kernel run without module"),
        ("real(0.5)", "0.5", "20: bare float 0.5 in half"),
        ("wp.float64(2.0)", "2.0", "24: bare float 2.0 in run"),
        ("wp.float64(2.0)", "wp.float64(1.0 / 6.0)", "24: float32 arithmetic in wp.float64(1.0 / 6.0) of run"),
        ("real(0.5)", "real(-(0.5 - 1.0))", "20: float32 arithmetic in real(-(0.5 - 1.0)) of half"),
        ("wp.float64(1.0)", "wp.float64(2.0 * 0.5)", "13: float32 arithmetic in wp.float64(2.0 * 0.5) of flat"),
        ("wp.float64(1.0)", "wp.float64(wp.sqrt(0.5 + a[0]))", "13: float32 arithmetic in"),
    ],
)
def test_each_slip_is_seen(tool, old, new, what):
    assert tool.check_source(GOOD, "model.py") == []
    assert old in GOOD and "real(-0.5)" in GOOD
    [problem] = tool.check_source(GOOD.replace(old, new), "model.py")
    assert problem.startswith("model.py:")
    assert what in problem


def test_command_says_that_all_is_well():
    done = subprocess.run([sys.executable, TOOL], capture_output=True, text=True)
    assert (done.returncode, done.stdout) == (0, "kernels: all rules kept\n")
