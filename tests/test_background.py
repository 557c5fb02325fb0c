"""Work beside the run: one piece at a time, and its errors reach the run."""

import threading

import pytest

from warpdem.errors import OutputError
from warpdem.output.background import Background


def fail():
    raise OutputError("result.pvd: cannot be written (No space left on device)")


def test_work_is_done_beside_the_caller_and_in_order():
    background, gate, done = Background(), threading.Event(), []
    background.start(lambda: (gate.wait(10), done.append(1)))
    assert done == []
    gate.set()
    background.start(lambda: done.append(2))
    assert done[0] == 1, "the next piece waits for the one before"
    background.settle()
    assert done == [1, 2]
    background.close()


@pytest.mark.parametrize("call", ["start", "settle", "close"])
def test_an_error_comes_out_of_the_next_call_once(call):
    background, done = Background(), []
    background.start(fail)
    with pytest.raises(OutputError, match="No space left"):
        getattr(background, call)(*([lambda: done.append(1)] if call == "start" else []))
    assert done == [], "nothing is written after a frame is missing"
    background.close()
