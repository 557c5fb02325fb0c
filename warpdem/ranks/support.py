"""What of a scene ranks cannot do yet: refused by name, before anything is computed."""

from collections.abc import Iterator

from warpdem.core.device import pick_device
from warpdem.errors import SceneError
from warpdem.scene.model import Scene

REMEDY = "run it in one process, with --threads"


def refuse(scene: Scene, device: str | None) -> None:
    """Refuse what cannot be run over several ranks.

    Raises:
        SceneError: with all of it, by key.
    """
    scenes = [scene.phase(k) for k in range(len(scene.phases))] if scene.phases else [scene]
    found = sorted({name for one in scenes for name in _missing(one)})
    if device is not None and not pick_device(device).is_cpu:
        found.append(f"device {device}")
    if found:
        raise SceneError(f"{scene.source}: several ranks (MPI processes) cannot do {', '.join(found)} yet: {REMEDY}")


def _missing(scene: Scene) -> Iterator[str]:
    if scene.contact.liquid != "none":
        yield "liquid bridges"
