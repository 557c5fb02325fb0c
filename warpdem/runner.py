"""A run with all its files, under the name that scripts import: ``from warpdem.runner import run_scene``."""

from warpdem.app.run import run_scene

__all__ = ["run_scene"]
