"""Mutation check: change one sign, factor or limit of ``kernels/`` at a time and see whether the fast tests notice.

    python tools/dev/mutate.py                          # the whole table, one mutant after the other
    python tools/dev/mutate.py --jobs 2 --only 'law_*'  # those whose names match; the rest of the result is kept
    python tools/dev/mutate.py --left                   # those that the last result leaves open or has not tried
    python tools/dev/mutate.py --list

The table is ``tools/dev/mutants.toml``; a model's mutants may stand in its own test file, see ``of_model``. Each
worker has a copy of the tree with kernels of its own, in which it writes a mutant, runs the tests that the table
names until one fails, and puts the file right again. A mutant that these do not notice and that has no ``reason`` is
tried on ``catch_all``, all fast tests that run the kernels. A test that crashes has noticed the mutant. The unchanged copy
has to pass first, and a mutant that does not even compile is no proof of a test: both are reported. Exit code 0 when every
mutant is killed or defended by a ``reason``, 1 when not, 2 when the check itself could not be made.
"""

import argparse
import ast
import fnmatch
import hashlib
import json
import os
import queue
import re
import shutil
import signal
import subprocess
import sys
import tempfile
import textwrap
import time
import tomllib
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
TABLE = ROOT / "tools" / "dev" / "mutants.toml"
RESULT = ROOT / "tools" / "dev" / "results" / "mutants.md"
MODEL_TESTS = ROOT / "tests" / "kernels"
PARTS = ("warpdem", "kernels", "scenes", "tests", "tools", "pyproject.toml", "README.md")
"""What the tests need of the tree."""
NOT_COMPILED = re.compile(r"WarpCodegen\w*Error|kernel build failed|\.cpp:\d+:\d+: error|SyntaxError|Could not find function")
CRASHES = (signal.SIGSEGV, signal.SIGBUS, signal.SIGABRT, signal.SIGFPE, signal.SIGILL)
"""Ends of a process that a kernel brings about; a signal from outside, such as that of a full memory, proves nothing."""
FAILED = re.compile(r"^(?:FAILED|ERROR) (.+?)(?: - (.*))?$", re.MULTILINE)


@dataclass(frozen=True)
class Mutant:
    """One line of the table."""

    name: str
    file: str
    """Below the root of the repository."""
    old: str
    """Text that stands in the file once."""
    new: str
    tests: tuple[str, ...]
    """Test files, or tests of them as pytest names them, in the order in which they are run."""
    reason: str = ""
    """Why no test can notice it, or none needs to; empty for mutants that must be killed."""

    @property
    def digest(self) -> str:
        """What the mutant changes, so that a result is not taken for that of another."""
        return hashlib.sha256("\0".join((self.file, self.old, self.new)).encode()).hexdigest()[:16]

    def changed(self, text: str) -> str:
        """The file's text with the mutant in it.

        Raises:
            ValueError: the original does not stand in the text exactly once.
        """
        if text.count(self.old) != 1:
            raise ValueError(f"{self.name}: {self.old!r} stands {text.count(self.old)} times in {self.file}, not once")
        return text.replace(self.old, self.new)


def read_table(path: Path = TABLE) -> tuple[list[Mutant], list[str]]:
    """Mutants, and the tests that a mutant goes through when its own do not notice it."""
    data = tomllib.loads(path.read_text())
    listed = [Mutant(**{**entry, "tests": tuple(entry["tests"])}) for entry in data["mutants"]]
    tests = sorted(MODEL_TESTS.glob("*/test_*.py")) if path == TABLE else []
    return listed + [mutant for test in tests for mutant in of_model(test)], data["catch_all"]


def of_model(test: Path) -> list[Mutant]:
    """Mutants of a model that its own test file lists: ``MUTANTS = [(old, new), ...]``; none if it has no such list."""
    assigned = [node for node in ast.parse(test.read_text()).body if isinstance(node, ast.Assign)]
    lists = [node.value for node in assigned if [getattr(t, "id", "") for t in node.targets] == ["MUTANTS"]]
    pairs = ast.literal_eval(lists[0]) if lists else []
    role, name = test.parent.name, test.stem.removeprefix("test_")
    where = f"kernels/{role}/{name}.py", (test.relative_to(ROOT).as_posix(),)
    return [Mutant(f"{role}_{name}_{k}", where[0], old, new, where[1]) for k, (old, new) in enumerate(pairs)]


class Workplace:
    """A copy of the tree that tests are run in."""

    def __init__(self, folder: Path, cache: Path):
        self.folder = folder
        for part in PARTS:
            source = ROOT / part
            if source.is_dir():
                shutil.copytree(source, folder / part, ignore=shutil.ignore_patterns("__pycache__", "results"))
            else:
                shutil.copy(source, folder / part)
        for mapped in ("kernels", "scenes"):  # folders that an installation maps into the package
            link = folder / "warpdem" / mapped
            if link.is_symlink() or link.exists():
                shutil.rmtree(link) if link.is_dir() and not link.is_symlink() else link.unlink()
            link.symlink_to(Path("..") / mapped)
        # no bytecode: it is told apart by size and second of change, and mutants of one length follow in less
        self.environment = os.environ | {
            "PYTHONPATH": str(folder), "PYTHONDONTWRITEBYTECODE": "1", "WARP_CACHE_PATH": str(cache),
            "OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1",
        }  # fmt: skip
        where = self._python("-c", "import warpdem.kernels.contact.law as law; print(law.__file__)", limit=300).stdout.strip()
        if not Path(where).resolve().is_relative_to(folder.resolve()):
            raise RuntimeError(f"tests would run on {where}, not on the copy in {folder}")

    def _python(self, *arguments: str, limit: float) -> subprocess.CompletedProcess:
        return subprocess.run(
            [sys.executable, *arguments], cwd=self.folder, env=self.environment, capture_output=True, text=True, timeout=limit,
            check=False,
        )  # fmt: skip

    def test(self, tests, limit: float) -> tuple[str, str]:
        """(outcome, which test says so): "passed", "failed", "timeout" or "not run" of ``tests`` up to the first failure."""
        try:
            done = self._python("-m", "pytest", "-x", "-q", "--tb=short", "-p", "no:cacheprovider", *tests, limit=limit)
        except subprocess.TimeoutExpired:
            return "timeout", f"after {limit:.0f} s"
        if done.returncode == 0:
            return "passed", ""
        if -done.returncode in CRASHES:
            return "failed", f"crash: {signal.Signals(-done.returncode).name}"
        found = FAILED.search(done.stdout)
        said = f"{found[1]}: {found[2] or ''}" if found else (done.stdout + done.stderr)[-300:]
        compiles = not NOT_COMPILED.search(done.stdout + done.stderr)
        return "failed" if done.returncode == 1 and found and compiles else "not run", said

    def judge(self, mutant: Mutant, catch_all: list[str], limit: float) -> dict:
        """Write the mutant, run its tests, put the file right: its line of the result."""
        path = self.folder / mutant.file
        original = path.read_text()
        start = time.monotonic()
        path.write_text(mutant.changed(original))
        try:
            outcome, by = self.test(mutant.tests, limit)
            by_all = outcome == "passed" and bool(catch_all) and not mutant.reason
            if by_all:
                outcome, by = self.test(catch_all, limit * 5)
                if outcome == "timeout":  # of a busy machine: its own tests came to their end
                    outcome = "not run"
        finally:
            path.write_text(original)
        named = by_all and outcome == "failed" and not by.startswith("crash")
        if named and self.test([by.split(": ")[0]], limit)[0] != "passed":
            outcome, by = "not run", f"fails on the unchanged kernels, too: {by}"
        status = {"passed": "survived", "failed": "killed", "timeout": "killed"}.get(outcome, outcome)
        return {
            "name": mutant.name, "file": mutant.file, "digest": mutant.digest, "status": status, "by": by,
            "seconds": round(time.monotonic() - start, 1),
        }  # fmt: skip


def judge_all(mutants, catch_all, places: list[Workplace], limit: float, report) -> None:
    """Judge the mutants, one at a time in each place; ``report`` gets each result as it comes."""
    free: queue.Queue[Workplace] = queue.Queue()
    for place in places:
        free.put(place)

    def one(mutant: Mutant) -> dict:
        place = free.get()
        try:
            return place.judge(mutant, catch_all, limit)
        finally:
            free.put(place)

    with ThreadPoolExecutor(len(places)) as pool:
        for result in pool.map(one, mutants):
            report(result)


def markdown(results: list[dict], mutants: list[Mutant]) -> str:
    """The table of results."""
    known = {m.name: m for m in mutants}
    killed = sum(r["status"] == "killed" for r in results)
    defended = [r for r in results if r["status"] != "killed" and known[r["name"]].reason]
    open_ = [r for r in results if r["status"] != "killed" and not known[r["name"]].reason]
    seconds = sum(r["seconds"] for r in results)
    lines = [
        "# Mutants of the kernels",
        "",
        f"`python tools/dev/mutate.py`: {len(results)} of {len(mutants)} mutants tried, {killed} killed, "
        f"{len(defended)} defended, {len(open_)} open; {seconds / 60:.0f} minutes of work in all.",
        "",
    ]
    for r in results:
        test = re.sub(r"\[.*", "", r["by"].split(": ")[0]).removeprefix("tests/").replace("::", " ")
        by = known[r["name"]].reason if r["status"] != "killed" and known[r["name"]].reason else test
        line = f"`{r['name']}` ({r['file'].removeprefix('kernels/')}): {r['status']} in {r['seconds']:.0f} s; {by}"
        lines.append(textwrap.fill(line, 118, initial_indent="* ", subsequent_indent="  ", break_on_hyphens=False))
    return "\n".join(lines) + "\n"


class Record:
    """Results on disk, beside those of mutants that were not asked for this time."""

    def __init__(self, path: Path, mutants: list[Mutant]):
        self.path, self.mutants = path, mutants
        self.lines: dict[str, dict] = {}
        kept = path.with_suffix(".json")
        if kept.is_file():
            of = {m.name: m.digest for m in mutants}
            self.lines = {r["name"]: r for r in json.loads(kept.read_text()) if of.get(r["name"]) == r["digest"]}

    def add(self, result: dict) -> None:
        """Take a result in, write all and tell it."""
        self.lines[result["name"]] = result
        ordered = [self.lines[m.name] for m in self.mutants if m.name in self.lines]
        self.path.parent.mkdir(parents=True, exist_ok=True)
        for path, text in (
            (self.path.with_suffix(".json"), json.dumps(ordered, indent=1) + "\n"),
            (self.path, markdown(ordered, self.mutants)),
        ):
            draft = path.with_name(path.name + ".draft")  # so that a check that is stopped leaves what it had
            draft.write_text(text)
            draft.replace(path)
        print(f"{result['status']:9} {result['seconds']:6.1f} s  {result['name']:40} {result['by'][:90]}", flush=True)

    def is_open(self, mutant: Mutant) -> bool:
        """Whether the mutant, as it stands now, is neither killed nor tried and defended."""
        line = self.lines.get(mutant.name)
        return line is None or (line["status"] != "killed" and not mutant.reason)


def main(arguments: list[str] | None = None) -> int:
    """Run the command; returns the exit code."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--only", action="append", metavar="PATTERN", help="mutants whose names match, * and ? allowed")
    parser.add_argument("--left", action="store_true", help="only mutants that the last result leaves open or has not tried")
    parser.add_argument("--jobs", type=int, default=1, help="mutants at a time (default 1)")
    parser.add_argument("--limit", type=float, default=300.0, help="seconds for the tests of a mutant (default 300)")
    parser.add_argument("--no-catch-all", action="store_true", help="only the tests that the table names for each mutant")
    parser.add_argument("--out", type=Path, default=RESULT, metavar="FILE.md", help="result, with a .json beside it")
    parser.add_argument("--list", action="store_true", help="name the mutants and end")
    options = parser.parse_args(arguments)
    mutants, catch_all = read_table()
    asked = [m for m in mutants if not options.only or any(fnmatch.fnmatch(m.name, p) for p in options.only)]
    record = Record(options.out, mutants)
    if options.left:
        asked = [m for m in asked if record.is_open(m)]
    if options.list:
        for m in asked:
            print(f"{m.name:40} {m.file:36} {' '.join(m.tests)}")
        return 0
    if not asked:
        print(f"no mutant{' is left of' if options.left else ' is called'} {' or '.join(options.only or ['all'])}: see --list",
              file=sys.stderr)  # fmt: skip
        return 0 if options.left else 2
    for m in asked:  # before anything is copied
        try:
            m.changed((ROOT / m.file).read_text())
        except (OSError, ValueError) as wrong:
            print(wrong, file=sys.stderr)
            return 2
    with tempfile.TemporaryDirectory(prefix="mutants_") as work:
        cache = Path(os.environ.get("WARP_CACHE_PATH", Path(work) / "cache"))
        places = [Workplace(Path(work) / f"copy{k}", cache) for k in range(min(options.jobs, len(asked)))]
        tests = list(dict.fromkeys(t for m in asked for t in m.tests))
        outcome, by = places[0].test(tests, 60.0 * (1 + len(tests)))  # also fills the kernel cache
        if outcome != "passed":
            print(f"the tests do not pass on the unchanged kernels: {by}", file=sys.stderr)
            return 2
        judge_all(asked, [] if options.no_catch_all else catch_all, places, options.limit, record.add)
    left = [m.name for m in asked if record.is_open(m)]
    print(f"{len(asked) - len(left)} of {len(asked)} killed or defended" + (f"; open: {', '.join(left)}" if left else ""))
    return 1 if left else 0


if __name__ == "__main__":
    sys.exit(main())
