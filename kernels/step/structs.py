"""The structs that the kernels of a step take: what is read, what is written, and which part of it a thread does.

    Model            read: coefficients, walls and time step, the same in all steps
    Control          read: schedule and limits of a batch of steps
    Steps            read: which steps a launch makes
    ForceCall        read: the rows and generations of one force call
    Range            read: the contacts or grains that a thread takes
    Grains           read and written: the grains and the forces on them
    ContactBatches   read and written: the contacts between grains
    Report           written: what the host reads after a batch of steps

``WallContacts``, read and written, is of ``wall.evaluate``. (n,) are the memory slots of grains.
"""

import functools

import warp as wp
from warpdem.kernels import KernelSet, grain
from warpdem.kernels.field import Numbers
from warpdem.kernels.lists.path import Flight
from warpdem.kernels.measure.budget import Momenta, energies_type
from warpdem.kernels.measure.flow import Plane
from warpdem.kernels.step.dynamic_walls import DynamicWalls
from warpdem.kernels.step.region import Regions
from warpdem.kernels.step.schedule import FrameRow, Placement, Row
from warpdem.kernels.wall.surface import Surface

SPAN = 16  # numbers per thread in shared arrays: a cache line, so that threads do not disturb each other
CONTACTS, GRAINS, WALL_GRAINS, BOUNDARY = 0, 2, 4, 6
"""Columns of ``Control.thread_ranges``: where the range of each begins; BOUNDARY: contact batches with ghosts."""


@wp.struct
class Control:
    """What the host hands to a batch of steps; read only, but for walls that move by the load on them."""

    row: wp.array(dtype=Row)  # (rows,) per force call
    frame: wp.array(dtype=FrameRow)  # (rows,) per force call; of size 0 where nothing needs the frame's motion
    placement: wp.array2d(dtype=Placement)  # (rows, motions); those of ``dynamic`` are written
    dynamic: DynamicWalls  # walls that move by the load on them; written
    origin: wp.array(dtype=wp.int32)  # (1,) step that the first row belongs to
    field: wp.array(dtype=Numbers)  # (fields,) numbers of each external field
    outlet: Regions  # where grains leave
    removes_in_step: wp.array(dtype=wp.int32)  # (outlets,) 1 if the step itself removes a grain in it, 0 if the host does
    plane: wp.array(dtype=Plane)  # (planes,) where their flow is measured
    wear_from: wp.array(dtype=wp.int32)  # (1,) first step whose wear counts
    cutting: wp.array(dtype=wp.float64)  # (1,) K of Finnie's law, see ``measure.wear``
    max_overlap: wp.array(dtype=wp.float64)  # (1,) largest allowed overlap over the radius [-]
    thread_ranges: wp.array2d(dtype=wp.int32)  # (threads, 8) first and last of each; of ``CONTACTS`` ... ``BOUNDARY``
    wait_modes: wp.array(dtype=wp.uint64)  # (4,) how a thread waits at the barrier, of ``barrier.wait_modes``


@wp.struct
class Report:
    """What a batch of steps hands back; written."""

    moved: wp.array(dtype=wp.int32)  # (threads * SPAN,) per thread: BEYOND, LEFT of its grains, of ``motion``
    extreme: wp.array(dtype=wp.float64)  # (threads * SPAN,) per thread: overlap ratio [-], approach speed [m/s], pairs, walls
    wear: wp.array3d(dtype=wp.int64)  # (threads, sums of the features, digits) what wears walls, of ``measure.wear``
    losses: wp.array3d(dtype=wp.int64)  # (rows, losses, digits) of contacts between grains, rows of ``measure.window_sum``
    done: wp.array(dtype=wp.int32)  # (1,) steps
    removed: wp.array(dtype=wp.int32)  # (1,) 1 when a step removed a grain
    arrivals: wp.array(dtype=wp.int32)  # (barrier.LENGTH,) arrivals at the barrier
    taken: wp.array(dtype=wp.int32)  # (threads * SPAN,) of each range: contact batches that are taken in this force call


@wp.struct
class Steps:
    """Which steps a launch makes; read only."""

    row: wp.int32  # of the first step in the schedule
    count: wp.int32
    forces_first: wp.int32  # 1: evaluate the forces of the present positions first
    hold: wp.int32  # 1: leave the forces after the last step to the next launch
    parity: wp.int32  # of the number of the first step
    inner_share: wp.float64  # of its allowance, that a grain may move while the inner list holds [-]
    exchange: wp.uint64  # function of the host that ``exchange.exchange`` calls; 0 in a run of one process


@wp.struct
class ForceCall:
    """Where a force call reads and writes: rows of the schedule, generations of the wall contacts; read only."""

    stage: wp.int32
    row: wp.int32  # of ``Control.row`` and ``Control.frame``
    before: wp.int32  # row of the placements: where springs slip from
    now: wp.int32  # row of the placements: at present
    old_generation: wp.int32  # of the contact points at walls: read
    new_generation: wp.int32  # written


@wp.struct
class Range:
    """Contacts or grains ``first``, ``first + stride`` ... below ``last`` that a thread takes; read only."""

    first: wp.int32
    last: wp.int32
    stride: wp.int32
    slot: wp.int32  # of the thread in ``Report.moved`` and ``Report.extreme``


@wp.func
def consecutive(first: int, last: int, thread: int) -> Range:
    """From ``first`` on, below ``last``, for ``thread``."""
    part = Range()
    part.first = first
    part.last = last
    part.stride = 1
    part.slot = thread * wp.static(SPAN)
    return part


@wp.func
def range_of(thread: int, column: int, control: Control) -> Range:
    """What ``thread`` takes of CONTACTS, GRAINS, WALL_GRAINS or BOUNDARY."""
    return consecutive(control.thread_ranges[thread, column], control.thread_ranges[thread, column + 1], thread)


@wp.func
def every(stride: int, last: int, thread: int) -> Range:
    """What ``thread`` of ``stride`` takes, where they take turns."""
    part = Range()
    part.first = thread
    part.last = last
    part.stride = stride
    part.slot = thread * wp.static(SPAN)
    return part


@wp.func
def one(i: int) -> Range:
    """Grain ``i`` alone."""
    part = Range()
    part.first = i
    part.last = i + 1
    part.stride = 1
    return part


@functools.cache
def build_call(stages: int):
    """Return ``force_call`` of a scheme with ``stages`` force calls per step."""

    @wp.func
    def force_call(step: int, stage: int, parity: int) -> ForceCall:
        """Force call ``stage`` of the step in row ``step`` of the schedule, whose number has this ``parity``.

        A stage within a step slips from the contact points of the step's beginning; what it makes of them is discarded.
        """
        call = ForceCall()
        call.stage = stage
        call.row = step * wp.static(stages) + stage
        call.now = (step + 1) * wp.static(stages) + stage
        call.before = call.now - wp.static(stages)
        call.old_generation = 1 - parity
        call.new_generation = parity
        if stage > 0:
            call.before = call.now - stage
            call.old_generation = parity
            call.new_generation = 2
        return call

    return force_call


@functools.cache
def build(pairs):
    """Return the structs whose types depend on the contact law.

    Args:
        pairs: namespace of ``pairs.build``.
    """
    real = pairs.real
    g = grain.build(pairs.spins)
    Inverse, Clumps = pairs.clumps.Inverse, pairs.clumps.Clumps
    Energies = energies_type(pairs.law.losses)

    @wp.struct
    class Model:
        """What is the same in all steps; read only."""

        coefficients: wp.array(dtype=pairs.Coefficients)  # (materials * materials,), or (1,) where all contacts share them
        materials: wp.int32
        surface: Surface  # of the walls
        dt: wp.float64  # time step [s]
        # of a law with bridges (``contact.films``)
        quantum: wp.float64  # volume of a count of liquid [m3]
        most_from_film: wp.float64  # counts that a film gives to a bridge at most

    @wp.struct
    class Grains:
        """State and constants per grain, in memory order, and the forces on them."""

        # read only
        inverse: wp.array(dtype=Inverse)  # (n,) 1/m [1/kg], 1/I [1/(kg m2)]; of members of clumps written in the step
        material: wp.array(dtype=wp.int32)  # (n,)
        reference: wp.array2d(dtype=wp.vec3d)  # (n, 1 + motions) of the inner list, of ``displacement``
        allowance: wp.array(dtype=wp.float64)  # (n,) of the outer list, of ``neighbors`` [m]
        slot_start: wp.array(dtype=wp.int32)  # (n + 1,) first force slot of each
        # written by the integrator
        record: wp.array(dtype=g.Record)  # (n,)
        orientation: wp.array(dtype=wp.vec4d)  # (n,), or of size 0
        store: wp.array2d(dtype=wp.vec3d)  # (n, STORE) what it keeps between the stages of a step
        flight: wp.array(dtype=Flight)  # (n,), or of size 0 when no grain is in flight; ended where a grain leaves
        exit: wp.array2d(dtype=wp.int32)  # (n, 2) 1 + number of the outlet that it left by in this batch, and the step
        clumps: Clumps  # of empty arrays without clumps
        film: wp.array2d(dtype=wp.int64)  # (n, 3) of ``contact.films.FILM_AT``; of a law with bridges
        # written by the contacts
        slot_force: wp.array(dtype=pairs.PairForce)  # (force slots + 1,)
        # added up
        energies: wp.array(dtype=Energies)  # (n,) by walls, fields and what is carried
        momenta: wp.array(dtype=Momenta)  # (n,)
        wall_work: wp.array2d(dtype=wp.float64)  # (n, walls) [J]
        flow: wp.array2d(dtype=wp.float64)  # (n, 2 planes) mass [kg] and number through each

    @wp.struct
    class ContactBatches:
        """Grain-grain contacts in batches of SIMD lanes."""

        # read only
        owner: wp.array2d(dtype=wp.int32)  # (batches, lanes) slot of the grain with the lower id
        partner: wp.array2d(dtype=wp.int32)  # (batches, lanes)
        kind: wp.array2d(dtype=wp.int32)  # (batches, lanes) row of the coefficients
        constants: wp.array3d(dtype=real)  # (batches, numbers, lanes)
        slot_i: wp.array2d(dtype=wp.int32)  # (batches, lanes) force slot of the owner
        slot_j: wp.array2d(dtype=wp.int32)  # and of the partner
        owned: wp.int32  # grains before this slot belong to this process; in a run over several
        # written
        history: wp.array3d(dtype=real)  # (batches, numbers, lanes) ``Memory`` of each
        trial: wp.array3d(dtype=real)  # history after a stage within the step; it is discarded

    return KernelSet(
        Model=Model, Grains=Grains, ContactBatches=ContactBatches, PairForce=pairs.PairForce, Energies=Energies,
    )  # fmt: skip
