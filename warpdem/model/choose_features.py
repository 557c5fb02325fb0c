"""What a scene needs: the only place that decides what is compiled, allocated and run, and what is left out."""

import numpy as np

from warpdem.kernels.contact import columns
from warpdem.kernels.wall import shapes
from warpdem.model.coefficients import coefficient_columns, coefficient_table, law_gap
from warpdem.model.domain import Domain
from warpdem.model.features import (
    BackendFeatures,
    ContactFeatures,
    DomainFeatures,
    Features,
    FrameFeatures,
    MeasureFeatures,
    WallFeatures,
)
from warpdem.model.liquid import liquid_reach
from warpdem.scene.free import FreeBody
from warpdem.scene.model import Scene
from warpdem.scene.models import model
from warpdem.scene.motion_chain import frame_chain
from warpdem.scene.user_models import digest, is_file, parts_of

SIMD_LANES = 4  # four doubles fill an AVX2 register
WARP_LANES = 32  # a GPU thread takes one contact, and a warp of 32 threads one batch: it reads consecutive memory


def choose_features(
    scene: Scene,
    grain_types: np.ndarray,
    *,
    has_spin: bool,
    moving: int,
    resting: int,
    images: bool,
    lanes: int = SIMD_LANES,
    resident: bool = False,
    largest: float = 0.0,
    clumps: bool = False,
) -> Features:
    """Decide what ``scene`` needs.

    Args:
        scene: the validated scene.
        grain_types: material index per grain, shape (n,).
        has_spin: whether some grain spins at the start.
        moving: number of wall motions relative to the frame.
        resting: number of wall motions that rest in it.
        images: whether walls act at their periodic images too.
        lanes: SIMD width.
        resident: steps run as one captured graph.
        largest: radius of the largest grain that may come [m].
        clumps: some grains are members of clumps.
    """
    names = list(scene.materials)
    at = coefficient_columns(scene)
    table = coefficient_table(scene).reshape(len(names), len(names), at.width)
    present = sorted(set(np.unique(grain_types).tolist()))
    others = sorted(set(present) | {names.index(w.material) for w in scene.walls})
    separate = scene.apart
    used = np.array([table[a, b] for a in present for b in others if not separate[a, b]]).reshape(-1, at.width)
    left_out = {}
    apart = any(separate[a, b] for a in present for b in others)
    if not apart:
        left_out["materials that do not touch"] = "all that meet touch"
    normal = scene.normal_law
    tangential: str | None = None if scene.contact.tangential == "none" else scene.located(scene.contact.tangential)
    rolling: str | None = None if scene.contact.rolling == "none" else scene.located(scene.contact.rolling)
    if tangential is None or not np.any(used[:, at.friction] > 0):
        left_out["tangential spring and Coulomb limit"] = (
            "contact.tangential is none" if tangential is None else "every friction coefficient is zero"
        )
        tangential = None
    if rolling is None or not np.any(used[:, at.rolling_friction] > 0):
        left_out["rolling resistance"] = (
            "contact.rolling is none" if rolling is None else "every rolling_friction is zero"
        )
        rolling = None
    twisting: str | None = None if scene.contact.twisting == "none" else scene.located(scene.contact.twisting)
    if twisting is None or tangential is None:
        left_out["twisting resistance"] = "contact.twisting is none" if twisting is None else "there is no friction"
        twisting = None
    if scene.contact.liquid == "none":
        left_out["liquid"] = "contact.liquid is none"
    spins = bool(tangential or rolling or has_spin or clumps)
    if not spins:
        left_out["spins and torques"] = "nothing turns a grain"
    orientation = scene.output.orientation and spins
    if not orientation:
        left_out["orientation of the grains"] = "output.orientation is false" if spins else "nothing turns a grain"
    frame = frame_chain(scene)
    if not frame.rotates:
        still = "the frame only shifts" if frame.moves else "the frame never moves"
        left_out["turning of the axes"] = "no frame" if scene.frame is None else still
    if not scene.walls:
        left_out["walls"] = "the scene has none"
    elif moving == 0:
        left_out["wall motion relative to the frame"] = "all walls rest in it"
    if scene.walls and all(wall.surface_velocity is None for wall in scene.walls):
        left_out["surface velocity of walls"] = "no wall has one"
    if scene.walls and all(wall.dynamic is None for wall in scene.walls):
        left_out["walls that move by the load on them"] = "no wall has a servo or is free"
    fields = tuple((scene.located(one.model), one.axes) for one in scene.fields)
    if not fields:
        left_out["external fields"] = "the scene has none"
    if not clumps:
        left_out["clumps"] = "every grain is a sphere of its own"
    if not scene.observers:
        left_out["observers"] = "the scene has none"
    chosen = [name for name in (*parts_of(normal), tangential, rolling, twisting, *(name for name, _ in fields)) if name]
    domain = Domain(scene)
    if not any(domain.period):
        left_out["periodic images"] = "no axis is periodic"
    if not domain.shapes:
        left_out["borders and outlets"] = "the scene has none"
    for name, on in (("energy", scene.measures.energy), ("momentum", scene.measures.momentum)):
        if not on:
            left_out[f"{name} budget"] = f"measures.{name} is not asked for"
    if not scene.measures.flow:
        left_out["flow through planes"] = "measures.flow names none"
    wears = scene.measures.wear is not None and bool(scene.walls)
    if not wears:
        left_out["wear of walls"] = "measures.wear is not asked for" if scene.walls else "there are no walls"
    one_kind = len(used) == 0 or bool(np.all(used == used[0]))
    if one_kind:
        left_out["table of coefficients"] = "all contacts share one set"
    return Features(
        contact=ContactFeatures(
            normal=normal,
            tangential=tangential,
            rolling=rolling,
            torsion=bool(rolling and scene.contact.torsion),
            spins=spins,
            materials=len(names),
            table=not one_kind,
            gap=max(law_gap(scene, largest), liquid_reach(scene, largest)),
            dry_gap=law_gap(scene, largest) if scene.contact.liquid != "none" else None,
            twisting=twisting,
            clumps=clumps,
            apart=apart,
        ),
        frame=FrameFeatures(
            rotates=frame.rotates, moves=frame.moves, tracked=moving == 0 or resting > 0 or any(domain.period)
        ),
        walls=WallFeatures(
            meshes=sum(w.mesh is not None for w in scene.walls),
            moving=moving,
            shapes=tuple(sorted({w.shape.KERNEL for w in scene.walls if w.shape is not None}, key=shapes.NUMBER.__getitem__)),
            images=images,
            conveying=any(w.surface_velocity is not None for w in scene.walls),
            dynamic=sum(w.dynamic is not None for w in scene.walls),
            bodies=sum(isinstance(w.dynamic, FreeBody) for w in scene.walls),
            free=sum(w.free is not None for w in scene.walls),
        ),
        domain=DomainFeatures(
            period=domain.period, lower=domain.lower, outlets=len(domain.shapes), kinds=domain.kinds, placed=domain.placed
        ),
        backend=BackendFeatures(
            integrator=scene.engine.integrator, lanes=lanes, precision=scene.engine.precision, resident=resident
        ),
        measures=MeasureFeatures(
            orientation=orientation,
            energy=scene.measures.energy,
            losses=columns.losses(model("normal", normal)) if scene.measures.energy else (),
            momentum=scene.measures.momentum,
            scene_walls=len(scene.walls) if scene.measures.energy else 0,
            flows=len(scene.measures.flow),
            wear=wears,
            residence=bool(scene.measures.residence),
            observers=tuple((scene.located(one.model), one.axes) for one in scene.observers),
        ),
        fields=fields,
        user_files=tuple(digest(name) for name in chosen if is_file(name)),
        left_out=left_out,
    )
