"""Warp's start: its line on a missing driver is held back, nothing else is, and standard error stays what it was."""

import os

import pytest

from warpdem.core import start_warp
from warpdem.errors import WarpdemError

LINE = b"Warp CUDA warning: Could not find or load the NVIDIA CUDA driver. GPU execution will not be available.\n"


@pytest.fixture(autouse=True)
def cache(monkeypatch, tmp_path):
    """A folder for compiled kernels, as the start of Warp would name it."""
    monkeypatch.setattr(start_warp.wp.config, "kernel_cache_dir", str(tmp_path))


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


@pytest.fixture
def no_cache(monkeypatch):
    """Warp as it is before it starts, with the environment alone to tell where its kernels go."""
    monkeypatch.setattr(start_warp.wp.config, "kernel_cache_dir", None)

    def begin(path):
        monkeypatch.setenv("WARP_CACHE_PATH", str(path))

        def init():
            start_warp.wp.config.kernel_cache_dir = folder = os.path.join(os.environ["WARP_CACHE_PATH"], "1.0")
            os.makedirs(folder, exist_ok=True)

        monkeypatch.setattr(start_warp.wp, "init", init)
        start_warp.start_warp.__wrapped__()

    return begin


def test_a_folder_of_kernels_that_cannot_be_made_is_named(no_cache, tmp_path):
    (tmp_path / "file").touch()
    said = r"WARP_CACHE_PATH: compiled kernels cannot be stored in .*file/below/1.0 \(Not a directory\); set .*WARP_CACHE_PATH"
    with pytest.raises(WarpdemError, match=said) as refused:
        no_cache(tmp_path / "file" / "below")
    assert refused.value.exit_code == 2
    no_cache(tmp_path / "good")  # the next try looks anew


def test_a_folder_of_kernels_without_right_to_write_must_hold_some(no_cache, tmp_path, monkeypatch):
    def refuse(*_, dir=None, **__):
        raise PermissionError(13, "Permission denied", dir)

    monkeypatch.setattr(start_warp.tempfile, "TemporaryFile", refuse)  # root may write anywhere
    with pytest.raises(WarpdemError, match=r"cannot be stored in .* \(Permission denied\)"):
        no_cache(tmp_path)
    (tmp_path / "1.0" / "wp_some_kernel_12ab").mkdir()
    (tmp_path / "1.0" / "wp_some_kernel_12ab" / "wp_some_kernel.o").touch()
    no_cache(tmp_path)


def test_descriptors_are_given_back(monkeypatch, capfd):
    before = len(os.listdir("/proc/self/fd")) if os.path.isdir("/proc/self/fd") else None
    starting(monkeypatch, LINE)
    if before is not None:
        assert len(os.listdir("/proc/self/fd")) == before
