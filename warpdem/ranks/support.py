"""What ranks cannot do yet: refused by name, before anything is computed."""

from warpdem.core.device import pick_device
from warpdem.errors import SceneError


def refuse(source: str, device: str | None) -> None:
    """Refuse to run the scene of the file ``source`` over several ranks on a GPU.

    Raises:
        SceneError: ``device`` is one.
    """
    if device is not None and not pick_device(device).is_cpu:
        raise SceneError(
            f"{source}: several ranks (MPI processes) run on CPUs so far, not on {device}: take --device cpu, or one process"
        )
