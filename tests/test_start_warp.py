"""Warp's start: its line on a missing driver is held back, nothing else is, and standard error stays what it was."""

import os

import pytest

from warpdem import start_warp

LINE = b"Warp CUDA warning: Could not find or load the NVIDIA CUDA driver. GPU execution will not be available.\n"


def starting(monkeypatch, *written, error=None):
    """Start as a process does for the first time, with a Warp that writes these lines."""

    def init():
        for text in written:
            os.write(2, text)
        if error is not None:
            raise error

    monkeypatch.setattr(start_warp.wp, "init", init)
    start_warp.start_warp.__wrapped__()


def test_only_the_line_on_the_driver_is_held_back(monkeypatch, capfd):
    other = b"Warp CUDA error: Warp requires CUDA driver 12.0 or higher\nhalf a line"
    starting(monkeypatch, LINE, other)
    os.write(2, b", and what comes after\n")
    assert capfd.readouterr().err == other.decode() + ", and what comes after\n"


def test_a_start_that_fails_is_told_in_full(monkeypatch, capfd):
    with pytest.raises(RuntimeError, match="failed"):
        starting(monkeypatch, b"a word on it\n", LINE, error=RuntimeError("failed"))
    os.write(2, b"after\n")
    assert capfd.readouterr().err == "a word on it\nafter\n"


def test_warp_starts_without_a_standard_error(monkeypatch):
    def closed(descriptor):
        raise OSError("bad file descriptor")

    started = []
    with monkeypatch.context() as patched:
        patched.setattr(os, "dup", closed)
        patched.setattr(start_warp.wp, "init", lambda: started.append(True))
        start_warp.start_warp.__wrapped__()
    assert started == [True]


def test_descriptors_are_given_back(monkeypatch, capfd):
    before = len(os.listdir("/proc/self/fd")) if os.path.isdir("/proc/self/fd") else None
    starting(monkeypatch, LINE)
    if before is not None:
        assert len(os.listdir("/proc/self/fd")) == before
