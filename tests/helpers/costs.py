"""The option --costs: processor seconds of each file of tests, what of them Warp's compiler took, and what other processes.

Processor time, unlike the wall time of ``--durations``, says the same on a busy machine. On a cold cache of kernels most of a
file's time is compiling, which goes to the first test that needs a kernel. Of the processes that a test starts those count for
whose end it waited, with what they compiled.
"""

import os
import time
from collections import Counter, defaultdict

import pytest
from warp._src import build

NAME = "costs"
LINES = 40
LONGEST = (
    "tests/kernels/contact/test_sweep.py", "tests/test_laws_anywhere.py", "tests/ranks/test_bits.py",
    "tests/scenes/test_gallery.py", "tests/test_free_walls.py", "tests/test_budget.py",
    "tests/verification/test_integrators.py",
    "tests/verification/test_clumps.py", "tests/test_outlets.py", "tests/test_borders.py", "tests/test_servo.py",
    "tests/test_free_bodies.py", "tests/test_guards.py", "tests/kernels/wall/test_sweep.py",
    "tests/verification/test_surface_velocity.py", "tests/verification/test_adhesion.py", "tests/test_streams.py",
)  # fmt: skip
"""Files that cost most, by what the option said: workers begin with them, so that none is left alone with one at the end."""


class Costs:
    """Plugin that measures each test and sums up by file; under xdist the workers measure and their parent sums up."""

    def __init__(self) -> None:
        self._compiles, self._compiling = 0, 0.0
        self._before = (0.0, 0.0, 0, 0.0)
        build.build_cpu = self._timed(build.build_cpu)  # Warp has no public hook; what it compiles for is not changed

    def _timed(self, compile_module):
        def timed(*arguments, **options):
            begin = time.thread_time()
            try:
                return compile_module(*arguments, **options)
            finally:
                self._compiles += 1
                self._compiling += time.thread_time() - begin

        return timed

    def _now(self) -> tuple[float, float, int, float]:
        times = os.times()
        children = times.children_user + times.children_system
        return time.process_time() + children, children, self._compiles, self._compiling

    @pytest.hookimpl(tryfirst=True)
    def pytest_runtest_setup(self, item) -> None:
        self._before = self._now()

    @pytest.hookimpl(hookwrapper=True)
    def pytest_runtest_makereport(self, item, call):
        outcome = yield
        if call.when == "teardown":  # with the fixtures, those shared by a file too
            costs = [now - then for now, then in zip(self._now(), self._before, strict=True)]
            outcome.get_result().user_properties.append((NAME, costs))

    def pytest_terminal_summary(self, terminalreporter) -> None:
        """The files that cost most."""
        reports = [report for group in terminalreporter.stats.values() for report in group]
        for line in table(reports):
            terminalreporter.write_line(line)


def longest_first(items: list) -> None:
    """Put tests in the order in which workers are to take their files: ``LONGEST``, then those with most tests.

    A worker takes whole files (``--dist loadfile``); by the number of tests alone a file of few long ones would come last.
    """
    files = [item.nodeid.split("::")[0] for item in items]
    count, first = Counter(files), {file: place for place, file in enumerate(LONGEST)}
    order = sorted(range(len(items)), key=lambda k: (first.get(files[k], len(first)), -count[files[k]], files[k]))
    items[:] = [items[k] for k in order]


def table(reports) -> list[str]:
    """Lines of the files that cost most, from the reports of their tests."""
    files: dict[str, list[float]] = defaultdict(lambda: [0.0, 0.0, 0.0, 0.0, 0.0])
    for report in reports:
        for name, costs in getattr(report, "user_properties", ()):
            if name == NAME:
                row = files[report.nodeid.split("::")[0]]
                row[:] = [a + b for a, b in zip(row, (1, *costs), strict=True)]
    rows = sorted(files.items(), key=lambda item: -item[1][1])
    total = [sum(column) for column in zip(*files.values(), strict=True)] if files else [0.0] * 5
    lines = ["processor seconds   of other processes   compiling (modules)   tests   file"]
    for name, (tests, seconds, others, compiles, compiling) in [("all files", total), *rows[:LINES]]:
        numbers = f"{seconds:17.1f} {others:20.1f} {compiling:11.1f} ({compiles:.0f})"
        lines.append(numbers.ljust(62) + f"{tests:5.0f}   {name}")
    return lines
