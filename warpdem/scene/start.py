"""Start of a scene from the checkpoint of another run, as scene data."""

from pydantic import Field
from pydantic.json_schema import SkipJsonSchema

from warpdem.scene.base import FileName, SceneModel


class Start(SceneModel):
    """The checkpoint that a scene starts from, instead of grains.

    Grains with their absolute motion and their contact history, the axes of the frame, and walls of the same name continue from
    their state in the checkpoint. Time and steps begin at 0, and with them the motions and streams of the scene.
    """

    checkpoint: FileName = Field(description="Checkpoint of another run (checkpoint.h5), relative to the scene file.")
    continues: list[str] = Field(
        [],
        description='Parts that keep their own time and continue, instead of starting again: "frame", "streams", names of '
        "walls; their motions must be those of the previous run. Default none.",
    )
    liquid: SkipJsonSchema[tuple[float, float] | None] = Field(
        None,
        exclude=True,
        description="Volumes of a count of its liquid and of what a film gives to a bridge at most [m3]; not used in files.",
    )
    groups: SkipJsonSchema[list[str]] = Field([], exclude=True, description="Names of its groups of grains; not used in files.")
