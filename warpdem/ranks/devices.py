"""The device that each rank computes on."""

import warp as wp

from warpdem.core.start_warp import start_warp
from warpdem.errors import SceneError


def device_name(asked: str | None, local_rank: int) -> str:
    """Name of the device of a rank.

    Args:
        asked: what the user asks for: "cuda" for a GPU of its own, else the device of all ranks; None for the CPU.
        local_rank: its number among the ranks of its machine; where these are more than GPUs, some share one.

    Raises:
        SceneError: there is no GPU.
    """
    if asked != "cuda":
        return asked or "cpu"
    start_warp()
    count: int = wp.get_cuda_device_count()
    if not count:
        raise SceneError("--device cuda: there is no GPU on this machine; give --device cpu")
    return f"cuda:{local_rank % count}"
