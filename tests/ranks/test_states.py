"""What a run over ranks says of its state wherever it ends; *against* one process."""

import json
import subprocess
import sys
from pathlib import Path

import pytest

pytest.importorskip("mpi4py")

from warpdem.ranks import launcher

PROGRAM = Path(__file__).parents[1] / "helpers" / "rank_states.py"


def states(size: int, *arguments: str) -> list:
    begin, environment = launcher.command(size)
    command = [*begin, sys.executable, PROGRAM, *arguments]
    done = subprocess.run(command, env=environment, capture_output=True, text=True, timeout=600)
    assert done.returncode == 0, done.stdout + done.stderr
    return json.loads(done.stdout)


def test_a_record_between_checkpoints_is_that_of_the_present_state():
    """Neither that of the last gathering nor that of the grains that have just left."""
    arguments = "soaked", "150,150,100"
    alone, shared = states(1, *arguments), states(3, *arguments)
    assert alone == shared
    assert len({state for _, state, _ in alone}) == 3
