"""Settings of a run as scene data: time, output and engine."""

from typing import Annotated, Literal

from pydantic import Field, StrictBool, field_validator, model_validator

from warpdem.scene.base import Duration, SceneModel, require_unique, validation_error
from warpdem.scene.units import Quantity


class Time(SceneModel):
    """Length and step of the run."""

    end: Duration = Field(
        description="End of the run [s], > 0; the run starts at 0 and ends with the first step at or after this time."
    )
    step: Annotated[float | Literal["auto"], Quantity("s", gt=0, auto=True)] = Field(
        "auto", description='Time step [s], > 0, or "auto" (default): as long as the results asked for by accuracy allow.'
    )
    accuracy: Literal["bulk", "impact"] = Field(
        "bulk",
        description='What step = "auto" is made for: "bulk" (default), flow, packing, loads and losses of many grains, from 8 '
        'to 12 steps in the contact time of an undamped impact at max_speed, as its restitution needs; "impact", the course '
        'of single impacts, from 40.',
    )
    max_speed: Annotated[float, Quantity("m/s", gt=0)] | None = Field(
        None,
        description="Largest expected speed [m/s], > 0, for the automatic step; default: estimated from the scene.",
    )

    @model_validator(mode="after")
    def _step_is_within_end(self) -> "Time":
        if self.step != "auto" and self.step > self.end:
            raise validation_error([(("step",), self.step, f"must not be longer than time.end = {self.end:g} s")])
        return self


class Output(SceneModel):
    """Output: what is written, and how often."""

    interval: Duration | None = Field(
        None, description="Time between two frames of the result [s], > 0, rounded to whole steps, default time.end / 50."
    )
    formats: list[Literal["vtk", "vtkhdf", "usd"]] = Field(
        ["vtk", "usd"],
        description='File formats of the frames: "vtk" (a file for each frame), "vtkhdf" (one file for ParaView), "usd"; '
        'default ["vtk", "usd"].',
    )
    pieces: Literal["auto", "one", "ranks"] = Field(
        "auto",
        description='Whether a frame is written as one, by the first rank ("one"), or as a piece for each rank, by that rank '
        '("ranks"); "auto" (default): in pieces where the scene begins with more than 2e7 grains.',
    )
    wall_loads: StrictBool = Field(
        True,
        description="Whether the frames hold the loads on mesh walls and their triangles, default true; VTK then writes a wall "
        "at rest in every frame, not once: some 25 bytes per triangle. history.csv always has the loads on whole walls.",
    )
    contacts: StrictBool = Field(
        False,
        description="Whether the frames hold the contact network, lines with force, overlap and sliding, default false; needs "
        "the format vtk or vtkhdf.",
    )
    orientation: StrictBool = Field(
        False,
        description="Whether the run integrates the orientation of each grain, and the frames hold it, default false.",
    )
    picture: StrictBool = Field(True, description="Whether a preview picture is drawn at the end, default true.")
    history_interval: Duration | None = Field(
        None,
        description="Time between two rows of history.csv [s], > 0, default interval / 4; every frame has a row at its time.",
    )
    checkpoint_interval: Duration | None = Field(
        None, description="Simulated time between two checkpoints [s], > 0, default none; see checkpoint_wall_time."
    )
    checkpoint_wall_time: Duration = Field(
        60.0, description="Wall time after which a checkpoint is written [s], > 0, default 60."
    )

    _no_format_twice = field_validator("formats")(require_unique)

    @model_validator(mode="after")
    def _contacts_have_a_format(self) -> "Output":
        if self.contacts and not {"vtk", "vtkhdf"} & set(self.formats):
            reason = 'only the formats "vtk" and "vtkhdf" hold contacts: add one to output.formats'
            raise validation_error([(("contacts",), True, reason)])
        return self


class Engine(SceneModel):
    """Numerical settings; they do not change the physical model."""

    skin: Annotated[float | Literal["auto"], Quantity("m", gt=0, auto=True)] = Field(
        "auto",
        description='Skin of the neighbor lists: distance beyond contact up to which pairs are listed [m], > 0, or "auto" '
        "(default).",
    )
    integrator: Literal[
        "exact_drift", "velocity_verlet", "modified_verlet", "scovel", "explicit_euler", "rk2", "rk4", "lobatto"
    ] = Field("exact_drift", description='Time integrator: "exact_drift" (default), or one of the schemes for comparison.')
    precision: Literal["double", "mixed"] = Field(
        "double",
        description='Precision: "double" (default), or "mixed": law, forces and history of grain pairs in single precision.',
    )
    max_overlap: Annotated[float, Quantity("-", gt=0, le=1)] = Field(
        0.1,
        description="Largest allowed overlap over the smaller radius (at a wall over the radius), at the start and during "
        "the run, above which a run stops [-], > 0 and <= 1, default 0.1.",
    )
    guards: Literal["stop", "record"] = Field(
        "stop",
        description='Action when a run becomes unstable: "stop" (default), or "record": note it in the summary and continue, '
        "for studies of schemes that are meant to fail; a state that is not finite always stops the run.",
    )
