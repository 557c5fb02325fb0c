"""A contact law of model modules, and its kernels in double precision."""

import functools
from types import ModuleType

import numpy as np
import warp as wp
from warpdem.kernels import MODULE_OPTIONS, KernelSet
from warpdem.kernels.api.grains import Load
from warpdem.kernels.contact import columns, thread_contact
from warpdem.kernels.contact import law as contact_law
from warpdem.kernels.contact import pairs as pair_contacts
from warpdem.kernels.lists import contact_batches, neighbors
from warpdem.kernels.step import border, motion, structs
from warpdem.kernels.step.schedule import Placement, Row, kick_time, slip_time
from warpdem.kernels.step.structs import ForceCall
from warpdem.kernels.wall import candidates, contact, evaluate, feature, images, record


class ContactLaw:
    """Contact law of model modules, with its coefficients for each pair of materials.

    Args:
        normal: module of ``warpdem.kernels.normal``, or one of your own that defines the same.
        tangential: module of ``warpdem.kernels.tangential``, or None.
        rolling: module of ``warpdem.kernels.rolling``, or None.
        materials: what the normal law reads of each material, as attributes: ``young_modulus`` [Pa], ``poisson_ratio`` [-].
        pairs: by indices (a, b) of two materials what the laws read of the pair, as attributes: ``restitution``, ``friction``,
            ``rolling_friction``, ``rolling_damping`` [-], and the keys that a law adds. Of the first four all but the
            restitution are 0 where they are missing.
        torsion: whether rolling resistance acts on the spin about the normal too.
        gap: how far beyond contact the normal law acts, at most [m]; 0 for a law of contact only.
    """

    def __init__(
        self, normal: ModuleType, tangential: ModuleType | None = None, rolling: ModuleType | None = None, *, materials,
        pairs, torsion: bool = False, gap: float = 0.0,
    ) -> None:  # fmt: skip
        self.models, self.torsion, self.materials, self.gap = (normal, tangential, rolling), torsion, len(materials), gap
        self.history = columns.history(normal, tangential, rolling).width
        table = np.full((len(materials), len(materials), columns.coefficients(normal).width), np.nan)
        for (a, b), pair in pairs.items():
            of_law = normal.coefficients(materials[a], materials[b], pair)
            of_pair = {key: getattr(pair, key, 0.0) for key in columns.OF_PAIR}
            table[a, b] = table[b, a] = columns.coefficient_row(of_law, of_pair)
        self.table = table.reshape(-1, table.shape[-1])

    def coefficients(self, device) -> wp.array:
        """Coefficients of the pair (a, b) in row ``a * materials + b``."""
        return wp.array(self.table, dtype=wp.types.vector(self.table.shape[1], wp.float64), device=device)


@functools.cache
def build_kernels(normal, tangential, rolling, torsion: bool, gap: float) -> KernelSet:
    """The kernels of a contact law in double precision, over a table of coefficients, and those of grains and walls.

    Args:
        normal, tangential, rolling, torsion, gap: as of ``ContactLaw``.
    """
    real, rolls = wp.float64, rolling is not None
    shared = {"spins": True, "table": True, "gap": gap}
    met = {"rolling": rolls, "inertia_factor": columns.inertia_factor(rolling)}
    remembered, stored = columns.history(normal, tangential, rolling), columns.stored_constants(normal, rolls)
    kernel = functools.partial(wp.kernel, enable_backward=False, module="unique", module_options=MODULE_OPTIONS)
    around = border.build((0.0, 0.0, 0.0), (0.0, 0.0, 0.0))
    wall_law = contact_law.build(real, normal, tangential, rolling, torsion, wall=True)
    pair_law = contact_law.build(real, normal, tangential, rolling, torsion)
    pair_kernels = pair_contacts.build(real, pair_law, None, around, spins=True, gap=gap)
    arrays = structs.build(pair_kernels)
    evaluate_pair = thread_contact.build(
        arrays, pair_kernels, pair_law.constants, spins=True, rotating_frame=False, table=True, **met
    )
    outer = neighbors.build(around, spins=True, gap=gap)
    batches = contact_batches.build(
        real, wall_law, outer.ListedGrains, around, 1, stored=stored, history=remembered.width,
        inertia_factor=met["inertia_factor"], keep_constants=False, **shared,
    )  # fmt: skip
    closest = feature.build(meshes=True, shapes=())
    seen = images.build(closest, around, repeated=False)
    one = contact.build(
        wall_law, None, around, seen, spins=True, rotating_frame=False, moving_frame=False, moving=0, **met
    )
    walls = evaluate.build(arrays, one, closest, around, seen, table=True, meshes=True, gap=gap)
    WallContacts, evaluate_wall_contacts = walls.WallContacts, walls.evaluate
    beside = candidates.build(
        seen, around, WallContacts, outer.ListedGrains, spins=True, meshes=True, shapes=False, gap=gap, leave=False
    )
    load_of = motion.build_load(real, spins=True, walls=False)

    @kernel
    def pair_forces(
        row: wp.array(dtype=Row),  # (1,)
        model: arrays.Model,
        # written
        grains: arrays.Grains,
        contacts: arrays.ContactBatches,  # of one contact each
        no_losses: wp.array3d(dtype=wp.int64),
    ):
        """Evaluate one contact per thread."""
        no_rotation = pair_kernels.AxesRotation()
        now = row[0]
        evaluate_pair(
            wp.tid(), 0, no_rotation, slip_time(now), kick_time(now), model, grains, contacts, contacts.history, no_losses, 0
        )

    @kernel
    def pair_load(
        start: wp.array(dtype=wp.int32),  # (n + 1,)
        pair_force: wp.array(dtype=pair_kernels.PairForce),
        no_walls: wp.array(dtype=wp.int32),
        none: wp.array(dtype=Load),
        load_out: wp.array(dtype=Load),  # (n,)
    ):
        """Sum over the contacts of each grain, in order of partner."""
        i = wp.tid()
        load_out[i] = load_of(i, start, pair_force, no_walls, none)

    @kernel
    def wall_forces(
        parity: int,  # of the step
        row: wp.array(dtype=Row),  # (1,)
        placement: wp.array2d(dtype=Placement),  # (1, 1)
        model: arrays.Model,
        grains: arrays.Grains,
        # written
        wall_contacts: WallContacts,
        load_out: wp.array(dtype=Load),  # (n,), added to
    ):
        """Evaluate one grain beside the wall per thread."""
        r = wp.tid()
        call = ForceCall()
        call.old_generation = 1 - parity
        call.new_generation = parity
        evaluate_wall_contacts(r, call, row[0], placement, model, grains, wall_contacts)
        i = wall_contacts.grain[r]
        load_out[i] = load_out[i] + wall_contacts.load[i]

    return KernelSet(
        neighbors=outer, batches=batches, beside=beside, WallContacts=WallContacts, pair_kernels=pair_kernels,
        pair_forces=pair_forces, pair_load=pair_load,
        wall_forces=wall_forces, structs=arrays, WallHistory=record.history_type(remembered), Result=record.result_type(rolls),
    )  # fmt: skip
