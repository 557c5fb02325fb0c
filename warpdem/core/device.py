"""Choice of the device that a run is computed on."""

import warp as wp

from warpdem.core.start_warp import start_warp
from warpdem.errors import SceneError


def pick_device(name: str | None) -> wp.Device:
    """The Warp device of that name; without a name the first GPU, or the CPU.

    Raises:
        SceneError: if there is no such device, with those there are.
    """
    start_warp()
    there = [d.alias for d in wp.get_devices()]
    if name is None:
        name = "cuda:0" if "cuda:0" in there else "cpu"
    if name not in there:
        raise SceneError(f"device = {name!r}: not on this machine; there is {', '.join(there)}")
    return wp.get_device(name)
