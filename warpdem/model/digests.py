"""Fingerprints of a scene and of the files that it names: two scenes that say the same have the same."""

import hashlib
import json
from dataclasses import dataclass
from pathlib import Path

from warpdem.core.key_path import key_text
from warpdem.scene.model import Scene
from warpdem.scene.user_models import LAWS, is_file


@dataclass(frozen=True)
class Given:
    """A scene as it was given, before anything of a checkpoint that it starts from is put in."""

    scene: Scene
    json: str
    """The scene as JSON: what a checkpoint holds of it."""
    files: dict[str, str]
    """``file_digests`` of the scene."""
    hash: str
    """``scene_hash`` of the scene."""

    @classmethod
    def of(cls, scene: Scene) -> "Given":
        """The scene with its digests."""
        files = file_digests(scene)
        return cls(scene, scene.model_dump_json(), files, scene_hash(scene, files))


def file_digests(scene: Scene) -> dict[str, str]:
    """SHA-256 of each file that the scene names, models among them, by the key that names it; missing ones are left out."""
    laws = [(f"contact.{role}", getattr(scene.contact, role)) for role in LAWS]
    laws += [(f"fields[{k}].model", field.model) for k, field in enumerate(scene.fields)]
    named = [(key_text(place), scene.resolve(name)) for place, name in scene.files()]
    named += [(key, Path(scene.located(name))) for key, name in laws if is_file(name)]
    return {key: _digest(path) for key, path in named if path.is_file()}


def _digest(path: Path) -> str:
    """SHA-256 of a file, which may be long."""
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def scene_hash(scene: Scene, files: dict[str, str] | None = None) -> str:
    """SHA-256 of the validated scene in SI units and of its files: two scenes that say the same have the same hash.

    Args:
        scene: validated scene.
        files: its ``file_digests``, if they are known.
    """
    table = scene.model_dump(mode="json", exclude={"start": {"checkpoint"}})  # wherever it lies, its contents count
    data = [table, file_digests(scene) if files is None else files]
    return hashlib.sha256(json.dumps(data, sort_keys=True).encode()).hexdigest()
