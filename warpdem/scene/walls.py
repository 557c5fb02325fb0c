"""Walls as scene data: a mesh file with its scale, rotation and translation, or one analytic shape."""

from pathlib import Path
from typing import Annotated, Literal, get_args

from pydantic import Discriminator, Field, StrictBool, Tag, field_validator, model_validator

from warpdem.scene.base import Direction, FileName, Name, Point, SceneModel, exactly_one, validation_error
from warpdem.scene.free import Free, FreeBody, Hinge, Slider
from warpdem.scene.motion import FixedPlacement, Motions
from warpdem.scene.servo import Servo
from warpdem.scene.shapes.cone import Cone
from warpdem.scene.shapes.cylinder import Cylinder
from warpdem.scene.shapes.plane import Plane
from warpdem.scene.shapes.shape import Shape
from warpdem.scene.shapes.sphere import Sphere
from warpdem.scene.surface_velocity import SurfaceVelocity
from warpdem.scene.units import Quantity, Vector
from warpdem.usd.stage import USD_SUFFIXES

STEP_SUFFIXES = (".step", ".stp")
PART_SUFFIXES = (".stl", ".obj", *STEP_SUFFIXES)
_Factor = Annotated[float, Quantity("-", gt=0)]
Scale = Annotated[
    Annotated[_Factor, Tag("~number")]
    | Annotated[tuple[float, float, float], Vector(Quantity("-", gt=0)), Tag("~axes")],
    Discriminator(lambda value: "~axes" if isinstance(value, (list, tuple)) else "~number"),
]
MESH_SUFFIXES = (".stl", ".obj", ".ply", *USD_SUFFIXES, *STEP_SUFFIXES)


class FixedRotation(SceneModel):
    """A rotation by an angle about an axis through the origin."""

    axis: Direction = Field(description="Direction of the axis [-], any length but zero; held as a unit vector.")
    angle: Annotated[float, Quantity("rad")] = Field(description="Angle [rad], by the right-hand rule.")


class Wall(SceneModel):
    """Wall: the triangles of a mesh file after scale, rotate and translate, in this order; or one analytic shape."""

    name: Name = Field(description="Unique name: letters, digits, _ and -.")
    material: str = Field(description="Name of the material.")
    mesh: FileName | None = Field(
        None,
        description="Mesh file (.stl, .obj, .ply, .usd, .usda, .usdc, .usdz, .step, .stp), relative to the scene file; this or "
        "one shape. A USD mesh is converted to metres with z upwards, whatever the stage's units and upAxis, a STEP file to "
        "metres.",
    )
    prim: Annotated[str, Field(pattern=r"^(/\S+)?$")] = Field(
        "",
        description='With a USD mesh: path of the prim whose surfaces are the wall, such as "/World/Drum"; not needed if the '
        "file holds only one surface.",
    )
    part: str = Field(
        "",
        description="Part of the mesh file that is the wall, by name: a solid of an ASCII STL or STEP file, an object or group "
        "of an OBJ; default the whole file.",
    )
    tolerance: Annotated[float, Quantity("m", gt=0)] | None = Field(
        None,
        description="With a STEP file: largest distance between the triangles that it is divided into and its surfaces [m], "
        "> 0, in its own size before scale; default 0.1 mm.",
    )
    plane: Plane | None = Field(None, description="Infinite plane; this, mesh or another shape.")
    cylinder: Cylinder | None = Field(None, description="Cylinder; this, mesh or another shape.")
    cone: Cone | None = Field(None, description="Cone; this, mesh or another shape.")
    sphere: Sphere | None = Field(None, description="Sphere; this, mesh or another shape.")
    scale: Scale = Field(
        1.0,
        description="Factor from the file's lengths to metres [-], > 0, default 1; 0.001 for a mesh in millimetres. Or three, "
        "one along each axis of the file.",
    )
    translate: Point = Field((0.0, 0.0, 0.0), description="Translation of the mesh [m], after scale and rotate, default 0.")
    rotate: FixedRotation | None = Field(
        None, description="Rotation of the mesh about the origin, after scale, default none."
    )
    fixed_to: Literal["frame", "laboratory"] = Field(
        "frame", description='What the wall is fixed to: "frame" (default) or "laboratory".'
    )
    motion: Motions | None = Field(
        None,
        description="Motion of the wall relative to what it is fixed to: one motion, or a list, outermost first; default none.",
    )
    surface_velocity: SurfaceVelocity | None = Field(
        None,
        description="Velocity of the surface along itself relative to the wall, which stays where it is, as of a belt: a "
        "vector in the wall's axes, of which the part along the surface acts; a table with velocity, schedule or table; or, "
        "for belts around drums, axis with speed, schedule or table: speed along axis x normal. Default none.",
    )
    driven: StrictBool = Field(
        False,
        description="Whether a program gives the wall other motions in a live run, by sim.set_motion of Python, default false. "
        "Until then it moves as motion says.",
    )
    servo: Servo | None = Field(
        None,
        description="A controller that moves the wall so that it loads the grains as asked: a force, a pressure or a torque. "
        "Its displacement comes on top of motion. Default none.",
    )
    free: Free | None = Field(
        None,
        description="A rigid body on a slider, on a hinge or free that grains, gravity, springs, dampers and a motor move. "
        "Default none.",
    )
    torque_about: Point | None = Field(
        None,
        description="Reference point of the torque on the wall [m]: a point of the wall's body, given by its position at time "
        "0 and moving with it. Default: origin of the wall's servo, hinge or own rotation, else of the frame's if fixed to "
        "it, else (0, 0, 0).",
    )
    liquid_film: Annotated[float, Quantity("m", ge=0)] = Field(
        0.0,
        description="Thickness of a film of liquid that the wall holds, whatever grains take of it [m], >= 0, default 0: a dry "
        "wall; needs contact.liquid.",
    )
    open: StrictBool = Field(
        False, description="Whether the mesh is meant to be open, with free edges; otherwise it must be closed, default false."
    )

    @field_validator("mesh")
    @classmethod
    def _known_suffix(cls, value: str | None) -> str | None:
        if value is not None and Path(value).suffix.lower() not in MESH_SUFFIXES:
            raise ValueError(f"must be a file ending in {', '.join(MESH_SUFFIXES)}")
        return value

    @model_validator(mode="after")
    def _prim_is_of_usd(self) -> "Wall":
        if self.prim and self.mesh is not None and not self.mesh.lower().endswith(USD_SUFFIXES):
            reason = f"only for a mesh from USD, a file ending in {', '.join(USD_SUFFIXES)}"
            raise validation_error([(("prim",), self.prim, reason)])
        return self

    @model_validator(mode="after")
    def _part_is_of_a_file_with_names(self) -> "Wall":
        if self.part and self.mesh is not None and not self.mesh.lower().endswith(PART_SUFFIXES):
            text = "a USD mesh has prims: give prim" if self.mesh.lower().endswith(USD_SUFFIXES) else "a PLY file has none"
            reason = f"only for a mesh with named parts, a file ending in {', '.join(PART_SUFFIXES)}; {text}"
            raise validation_error([(("part",), self.part, reason)])
        return self

    @model_validator(mode="after")
    def _tolerance_is_of_surfaces(self) -> "Wall":
        if self.tolerance is not None and self.mesh is not None and not self.mesh.lower().endswith(STEP_SUFFIXES):
            reason = f"only for a mesh from STEP, a file ending in {', '.join(STEP_SUFFIXES)}; others are triangles already"
            raise validation_error([(("tolerance",), self.tolerance, reason)])
        return self

    @model_validator(mode="after")
    def _mesh_or_shape(self) -> "Wall":
        exactly_one(self, "mesh", *SHAPES)
        if self.mesh is None:
            mesh_keys = ("prim", "part", "tolerance", "scale", "translate", "rotate", "open")
            stray = [key for key in mesh_keys if getattr(self, key) != Wall.model_fields[key].default]
            if stray:
                reason = "only for a mesh; a shape is positioned by its own keys"
                raise validation_error([((key,), getattr(self, key), reason) for key in stray])
        return self

    @model_validator(mode="after")
    def _servo_can_move_it(self) -> "Wall":
        if self.servo is None:
            return self
        if self.driven:
            raise validation_error([(("driven",), True, "not with servo: either a program moves the wall or the servo does")])
        if self.free is not None:
            raise validation_error([(("free",), None, "not with servo: a wall has one of them")])
        if self.servo.pressure is not None and self.servo.area is None and self.mesh is None:
            raise validation_error([(("servo", "area"), None, "missing: the pressure on a shape needs its area [m2]")])
        return self

    @model_validator(mode="after")
    def _free_is_free(self) -> "Wall":
        if self.free is None:
            return self
        if self.driven:
            reason = "not with free: either a program moves the wall or what acts on it does"
            raise validation_error([(("driven",), True, reason)])
        if any(not isinstance(motion, FixedPlacement) for motion in self.motion or ()):
            raise validation_error([(("motion",), None, "not with free, but for a fixed placement: what acts on it moves it")])
        if self.mesh is None or self.open:
            reason = "missing: only a closed mesh has one of its own"
            needed = ["mass"]
            if isinstance(self.free, FreeBody):
                needed = ["mass", "centre", "inertia"]
            elif self.free.rotates:
                needed = ["inertia"] if self.free.centre is None else ["inertia", "mass"]
            for key in needed:
                if getattr(self.free, key) is None:
                    raise validation_error([(("free", key), None, reason)])
        return self

    @property
    def dynamic(self) -> "Servo | Slider | Hinge | FreeBody | None":
        """What moves the wall by the load on it; None for a wall whose motion is prescribed."""
        return self.servo if self.servo is not None else self.free

    @property
    def shape(self) -> Shape | None:
        """The analytic shape; None for a mesh."""
        return next((shape for key in SHAPES if (shape := getattr(self, key)) is not None), None)


def _is_shape(annotation: object) -> bool:
    return any(isinstance(choice, type) and issubclass(choice, Shape) for choice in get_args(annotation))


SHAPES = tuple(key for key, field in Wall.model_fields.items() if _is_shape(field.annotation))
"""Keys of a wall that name an analytic shape."""
