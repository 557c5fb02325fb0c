"""Start of a scene from the checkpoint of another run, as scene data."""

from pydantic import Field
from pydantic.json_schema import SkipJsonSchema

from warpdem.scene.base import FileName, SceneModel


class Start(SceneModel):
    """The checkpoint that a scene starts from, in place of grains.

    Grains with their absolute motion and the springs of their contacts, the axes of the frame, and walls of the same name go
    on from where they stood. Time and steps begin at 0, and with them the scene's motions and streams.
    """

    checkpoint: FileName = Field(description="Checkpoint of another run (checkpoint.h5), relative to the scene file.")
    continues: list[str] = Field(
        [],
        description='What keeps its own time and goes on as it was, instead of beginning anew: "frame", "streams", names of '
        "walls; their motions must be those of the run before. Default none.",
    )
    groups: SkipJsonSchema[list[str]] = Field([], exclude=True, description="Names of its groups of grains; not for files.")
