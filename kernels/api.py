"""The kernels over arrays of your own: neighbor lists, contact forces, mesh walls and the drift, without a scene.

    grains = Grains(record, density=2500.0)             # record: your array, or that of ``records``
    law = ContactLaw(hertz, mindlin, materials=[glass], pairs={(0, 0): glass_on_glass})
    pairs, box = Pairs(grains, law, skin=2e-4), MeshWall(grains, law, mesh, skin=2e-4)
    for _ in range(steps):
        pairs.apply(dt)                                 # grains.load: contact force and torque of each grain
        box.apply(dt)                                   # adds to it
        wp.launch(my_kernel, ...)                       # yours: reads and adds to what it likes
        drift(grains, dt, gravity)                      # kick by the load, then drift

Each function launches the kernels that ``warpdem`` itself runs, one thread per contact, per grain at a wall and per grain, on
the device of the arrays. The result is that of the same scene run by ``warpdem.Simulation`` with ``exact_drift`` in axes at
rest. What this leaves out: moving walls and frames, periodic borders, analytic walls, mixed precision, the time step's limit
and all guards. README: ``API.md`` beside this file.
"""

import functools
from types import ModuleType

import numpy as np
import warp as wp
from warpdem.kernels import MODULE_OPTIONS, Built, grain
from warpdem.kernels.contact import columns, thread_contact
from warpdem.kernels.contact import law as contact_law
from warpdem.kernels.contact import pairs as pair_contacts
from warpdem.kernels.integrator import exact_drift
from warpdem.kernels.lists import neighbors
from warpdem.kernels.lists.cells import SizeGrids
from warpdem.kernels.lists.path import Flight
from warpdem.kernels.step import border, motion
from warpdem.kernels.step.schedule import FrameRow, Placement, Row, slip_time
from warpdem.kernels.wall import candidates, contact, feature, images, places, record
from warpdem.kernels.wall.surface import Ball, Revolved, Surface

Load = wp.types.vector(6, wp.float64)
Pair = wp.types.vector(2, wp.float64)
Record = grain.build(True).Record
"""What ``Grains`` holds per grain, 16 float64: see ``warpdem.kernels.grain``."""
EVERYWHERE = 1.0e30  # inner skin within which all partners of the neighbor list are evaluated [m]
ROOM = 16  # partners that the neighbor list has room for per grain to begin with
SEAM = 4.0  # mismatch allowed at the seams of a mesh over the largest distance of a corner from its plane [-]


# --- grains --------------------------------------------------------------------------------------


def records(position, radius, velocity=0.0, spin=0.0) -> np.ndarray:
    """Records of grains at rest in their axes' past: accelerations are zero.

    Args:
        position: positions [m], shape (n, 3).
        radius: radii [m], shape (n,) or one number.
        velocity: velocities [m/s], shape (n, 3) or one number.
        spin: angular velocities [rad/s], shape (n, 3) or one number.

    Returns:
        Shape (n, 16), float64: columns as in ``warpdem.kernels.grain``.
    """
    out = np.zeros((len(position), 16))
    out[:, grain.POSITION], out[:, grain.RADIUS] = position, radius
    out[:, grain.VELOCITY], out[:, grain.SPIN] = velocity, spin
    return out


class Grains:
    """State of the grains, in arrays that may be yours, and what acts on them.

    Velocity and spin are those half a step before the present instant, as the kick-drift scheme holds them; before the first
    step they are those of the start.

    Args:
        record: shape (n, 16) float64 or (n,) ``Record``, contiguous. A ``wp.array``, or any array that speaks DLPack; its
            memory is used, not copied, so it has to be writable and stays alive with this object.
        density: densities [kg/m3], shape (n,) or one number.
        material: index of each grain's material in the contact law, shape (n,) or one number.

    Attributes:
        record: ``wp.array`` of ``Record``, shape (n,).
        position: view of the record [m], ``wp.array`` of ``wp.vec3d``, shape (n,); likewise the next four.
        velocity: [m/s].
        acceleration: of the last step [m/s2].
        spin: [rad/s].
        angular_acceleration: of the last step [rad/s2].
        radius: view of the record [m], ``wp.array`` of ``wp.float64``, shape (n,).
        mass: [kg], ``wp.array`` of ``wp.float64``, shape (n,).
        load: force [N] and torque [N m] of each grain, ``wp.array`` of six ``wp.float64``, shape (n,).
        force: view of the load [N], ``wp.array`` of ``wp.vec3d``, shape (n,).
        torque: view of the load [N m], ``wp.array`` of ``wp.vec3d``, shape (n,).
        steps: how often ``drift`` was called.

    Raises:
        ValueError: the record has another shape or type.
    """

    def __init__(self, record, density, material=0) -> None:
        wp.init()
        given = record if isinstance(record, wp.array) else wp.from_dlpack(record)
        wanted = given.dtype is Record or (given.dtype is wp.float64 and given.ndim == 2 and given.shape[1] == 16)
        if not wanted or not given.is_contiguous:
            raise ValueError(f"record: shape (n, 16) of float64, contiguous, is wanted, not {given.shape} of {given.dtype}")
        self._given, self.device, n = given, given.device, given.shape[0]
        self.record = wp.array(ptr=given.ptr, shape=n, dtype=Record, device=self.device)
        self.position, self.velocity = self._column(0), self._column(4)
        self.acceleration, self.spin, self.angular_acceleration = self._column(7), self._column(10), self._column(13)
        self.radius = self._column(3, wp.float64)
        radius = self.radius.numpy()
        mass = density * 4.0 / 3.0 * np.pi * radius**3
        self.mass = wp.array(mass, dtype=wp.float64, device=self.device)
        self.inverse = wp.array(np.stack([1.0 / mass, 2.5 / (mass * radius**2)], axis=1), dtype=Pair, device=self.device)
        self.material = wp.array(np.broadcast_to(material, n).astype(np.int32), dtype=wp.int32, device=self.device)
        self.id = wp.array(np.arange(n), dtype=wp.int64, device=self.device)
        self.load = wp.zeros(n, dtype=Load, device=self.device)
        self.force, self.torque = self._column(0, of=self.load), self._column(3, of=self.load)
        self.steps = 0

    def __len__(self) -> int:
        return self.record.shape[0]

    def _column(self, first: int, dtype=wp.vec3d, of=None) -> wp.array:
        """View of the numbers from ``first`` on of each grain."""
        of = self.record if of is None else of
        return wp.array(
            ptr=of.ptr + 8 * first, shape=of.shape[0], strides=(of.strides[0],), dtype=dtype, device=self.device
        )


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


# --- kernels -------------------------------------------------------------------------------------


@functools.cache
def build(normal, tangential, rolling, torsion: bool, gap: float) -> Built:
    """The kernels of a contact law in double precision, over a table of coefficients, and those of grains and walls.

    Args:
        normal, tangential, rolling, torsion, gap: as of ``ContactLaw``.
    """
    real, rolls = wp.float64, rolling is not None
    shared = {"spins": True, "table": True, "gap": gap}
    met = {"rolling": rolls, "inertia_factor": 3.5 if rolls and rolling.HISTORY else 1.0}
    remembered, stored = columns.history(normal, tangential, rolling), columns.stored_constants(normal, rolls)
    kernel = functools.partial(wp.kernel, enable_backward=False, module="unique", module_options=MODULE_OPTIONS)
    around = border.build((0.0, 0.0, 0.0), (0.0, 0.0, 0.0))
    wall_law = contact_law.build(real, normal, tangential, rolling, torsion, wall=True)
    pair_law = contact_law.build(real, normal, tangential, rolling, torsion)
    pair_kernels = pair_contacts.build(real, pair_law, None, around, 1, stored=stored, turning_frame=False, **shared)
    evaluate = thread_contact.build(
        real, pair_law, pair_law.constants, pair_kernels, around, False, turning_frame=False, **met, **shared
    )
    lists = neighbors.build(
        real, wall_law, around, 1, stored=stored, history=remembered.width, inertia_factor=met["inertia_factor"],
        keep_constants=False, **shared,
    )  # fmt: skip
    closest = feature.build(True, False, False, False)
    seen = images.build(closest, around, repeated=False)
    WallContacts, evaluate_wall_contacts = contact.build(
        wall_law, None, closest, around, seen, turning_frame=False, moving_frame=False, meshes=True, moving=0, **met, **shared
    )  # fmt: skip
    beside = candidates.build(seen, around, WallContacts, spins=True, meshes=True, shapes=False, gap=gap, leave=False)
    load_of = motion.build_load(real, spins=True, walls=False)

    @kernel
    def pair_forces(
        record: wp.array(dtype=Record),  # (n,)
        inverse: wp.array(dtype=Pair),
        owner: wp.array2d(dtype=wp.int32),  # (contacts, 1)
        partner: wp.array2d(dtype=wp.int32),
        pair: wp.array2d(dtype=wp.int32),
        coefficients: wp.array(dtype=pair_kernels.Coefficients),
        row: wp.array(dtype=Row),  # (1,)
        dt: wp.float64,
        history_of: wp.array3d(dtype=wp.float64),  # (contacts, numbers, 1), read and written
        slot_i: wp.array2d(dtype=wp.int32),
        slot_j: wp.array2d(dtype=wp.int32),
        share_out: wp.array(dtype=pair_kernels.PairForce),  # (2 contacts + 1,)
        entry_out: wp.array(dtype=pair_kernels.Entry),  # (0,)
    ):
        """Evaluate one contact per thread."""
        t = wp.tid()
        evaluate(
            t, 0, record, owner, partner, inverse, pair, coefficients, pair_kernels.Turn(), slip_time(row[0]), dt,
            history_of,
            slot_i, slot_j, history_of, share_out, entry_out,
        )  # fmt: skip

    @kernel
    def pair_load(
        start: wp.array(dtype=wp.int32),  # (n + 1,)
        share: wp.array(dtype=pair_kernels.PairForce),
        nobody: wp.array(dtype=wp.int32),
        none: wp.array(dtype=Load),
        load_out: wp.array(dtype=Load),  # (n,)
    ):
        """Sum over the contacts of each grain, in order of partner."""
        i = wp.tid()
        load_out[i] = load_of(i, start, share, nobody, none)

    @kernel
    def wall_forces(
        record: wp.array(dtype=Record),
        inverse: wp.array(dtype=Pair),
        material: wp.array(dtype=wp.int32),
        materials: int,
        coefficients: wp.array(dtype=pair_kernels.Coefficients),
        surface: Surface,
        wall_contacts: WallContacts,
        placement: wp.array2d(dtype=Placement),  # (1, 1)
        row: wp.array(dtype=Row),
        parity: int,  # of the step
        dt: wp.float64,
        load_out: wp.array(dtype=Load),  # (n,), added to
    ):
        """Evaluate one grain beside the wall per thread."""
        r = wp.tid()
        evaluate_wall_contacts(
            r, record, inverse, material, materials, coefficients, surface, wall_contacts, placement, 0, 0, row[0],
            1 - parity, parity,
            dt,
        )  # fmt: skip
        i = wall_contacts.grain[r]
        load_out[i] = load_out[i] + wall_contacts.load[i]

    return Built(
        lists=lists, beside=beside, WallContacts=WallContacts, pair_kernels=pair_kernels, pair_forces=pair_forces,
        pair_load=pair_load,
        wall_forces=wall_forces, Memory=record.memory_type(remembered), Result=record.result_type(rolls),
    )  # fmt: skip


@functools.cache
def _motion() -> Built:
    """Kernels that know no contact law."""
    kernel = functools.partial(wp.kernel, enable_backward=False, module="unique", module_options=MODULE_OPTIONS)
    g = grain.build(True)
    acceleration_of = motion.build_acceleration((), spins=True, relative=False)
    advance, _ = exact_drift.build(spins=True, turning_frame=False, moving_frame=False)
    Numbers = motion.Numbers

    @kernel
    def move(
        record: wp.array(dtype=Record), load: wp.array(dtype=Load), inverse: wp.array(dtype=Pair), row: wp.array(dtype=Row),
        frames: wp.array(dtype=FrameRow), numbers: wp.array(dtype=Numbers), dt: wp.float64, store: wp.array2d(dtype=wp.vec3d),
    ):  # fmt: skip
        """Kick and drift of one grain per thread."""
        i = wp.tid()
        a, b = acceleration_of(record[i], load[i], inverse[i], row[0], frames, 0, dt, numbers)
        record[i] = advance(0, i, record[i], a, b, row[0], frames, 0, dt, store)

    @kernel
    def displaced(
        record: wp.array(dtype=Record), reference: wp.array(dtype=wp.vec3d), most: wp.float64, out: wp.array(dtype=wp.int32)
    ):  # fmt: skip
        """Set ``out`` when a grain is further than ``most`` [m] from its reference, or no number."""
        i = wp.tid()
        if not (wp.length(g.position(record[i]) - reference[i]) <= most):
            out[0] = 1

    return Built(move=move, displaced=displaced)


@functools.cache
def _row(dt: float, acceleration: tuple[float, float, float], first: bool, device: str) -> wp.array:
    """What the kernels must know of a step in axes at rest, ``schedule.Row``, shape (1,)."""
    numbers = np.zeros(29)
    numbers[0], numbers[1], numbers[2:5] = 0.0 if first else dt, 0.5 * dt if first else dt, acceleration
    return wp.array(numbers[None], dtype=Row, device=device)


def _starts(count: np.ndarray) -> np.ndarray:
    """Exclusive prefix sums with the total at the end, shape (n + 1,), int32."""
    return np.concatenate([[0], np.cumsum(count)]).astype(np.int32)


# --- lists and forces ----------------------------------------------------------------------------


class _Listed:
    """What was listed for grains at a reference position, and holds until one has moved by half the skin."""

    def __init__(self, grains: Grains, law: ContactLaw, skin: float) -> None:
        self.grains, self.law, self.skin, self.rebuilds = grains, law, skin, 0
        self.kernels = build(*law.models, law.torsion, law.gap)
        self._table = law.coefficients(grains.device)
        self._flag = wp.zeros(1, dtype=wp.int32, device=grains.device)
        self._reference: wp.array | None = None

    def launch(self, kernel, size: int, inputs: list) -> None:
        wp.launch(kernel, size, inputs, device=self.grains.device)

    def ints(self, shape, fill: int = 0) -> wp.array:
        return wp.full(shape, fill, dtype=wp.int32, device=self.grains.device)

    def outdated(self) -> bool:
        """Whether a grain has moved by more than half the skin since the list was made; waits for the device.

        Raises:
            ValueError: a position is no number.
        """
        if self._reference is None:
            return True
        self._flag.zero_()
        self.launch(_motion().displaced, len(self.grains), [self.grains.record, self._reference, 0.5 * self.skin, self._flag])
        if not self._flag.numpy()[0]:
            return False
        if not np.isfinite(self.grains.position.numpy()).all():
            raise ValueError("the position of a grain is no number")
        return True

    def update(self) -> bool:
        """Make the list if it is outdated; whether it was."""
        if not len(self.grains) or not self.outdated():
            return False
        self._make()
        self._reference = wp.clone(self.grains.position.contiguous())
        self.rebuilds += 1
        return True


class Pairs(_Listed):
    """Neighbor list and contacts of grains with each other.

    Args:
        grains: the grains.
        law: contact law.
        skin: gap up to which a pair is in the list [m]; the list is made again once a grain has moved by half of it. No bit of
            the result depends on it.

    Attributes:
        start: where the row of each grain begins in ``neighbor``, ``wp.array`` of int32, shape (n + 1,).
        count: neighbors of each grain, ``wp.array`` of int32, shape (n,).
        neighbor: indices of the neighbors, each row ascending, ``wp.array`` of int32.
        owner: the grain of lower index of each listed pair, ``wp.array`` of int32, shape (pairs, 1).
        partner: the other one, ``wp.array`` of int32, shape (pairs, 1).
        history: contact history of each listed pair, columns as in ``contact.columns.history``: tangential spring [m],
            rolling spring [rad], the normal law's own, as far as there are any; ``wp.array`` of float64, shape
            (pairs, numbers, 1), at least one number.
        rebuilds: how often the list was made.
    """

    def __init__(self, grains: Grains, law: ContactLaw, skin: float) -> None:
        super().__init__(grains, law, skin)
        self._room = ROOM
        self._old: list | None = None
        self._nobody, self._no_load = self.ints(0), wp.zeros(0, dtype=Load, device=grains.device)
        self._no_entry = wp.zeros(0, dtype=self.kernels.pair_kernels.Entry, device=grains.device)
        self.history = wp.zeros((0, max(law.history, 1), 1), dtype=wp.float64, device=grains.device)
        if len(grains) < 2:
            self.owner = self.partner = self.ints((0, 1))
            self.start = self._row_start = self.ints(len(grains) + 1)
            self._share = wp.zeros(1, dtype=self.kernels.pair_kernels.PairForce, device=grains.device)

    def apply(self, dt: float) -> None:
        """Write the sum of the contact forces and torques on each grain to ``grains.load``, for a step of ``dt`` [s]."""
        g, k = self.grains, self.kernels
        if len(g) > 1:
            self.update()
        row = _row(dt, (0.0, 0.0, 0.0), g.steps == 0, g.device.alias)
        if len(self.owner):
            self.launch(k.pair_forces, len(self.owner), [
                g.record, g.inverse, self.owner, self.partner, self._pair, self._table, row, dt, self.history,
                self._slot_i, self._slot_j, self._share, self._no_entry,
            ])  # fmt: skip
        self.launch(k.pair_load, len(g), [self._row_start, self._share, self._nobody, self._no_load, g.load])

    def _grid(self) -> SizeGrids:
        """One grid of cells as wide as two of the largest grains and the skin."""
        g, position = self.grains, self.grains.position.numpy()
        largest = float(g.radius.numpy().max())
        width = 2.0 * largest + self.law.gap + self.skin
        cells = np.minimum(np.ptp(position, axis=0) / width + 1.0, 256.0).astype(np.int32)
        grid = SizeGrids()
        grid.largest = wp.array([largest], dtype=wp.float64, device=g.device)
        grid.per_length = wp.array([1.0 / width], dtype=wp.float64, device=g.device)
        grid.cells = wp.array(cells[None], dtype=wp.vec3i, device=g.device)
        grid.first = self.ints(1)
        grid.head = self.ints(int(cells.prod()))
        grid.next = self.ints(len(g))
        return grid

    def _make(self) -> None:
        g, lists, n = self.grains, self.kernels.lists, len(self.grains)
        grid = self._grid()
        self.launch(lists.insert_grains, n, [0, grid, g.record])
        count = self.ints(n)
        while True:
            start = wp.array(np.arange(n + 1, dtype=np.int32) * self._room, device=g.device)
            slot = self.ints(n * self._room)
            self.launch(lists.find_neighbors, n, [0, grid, g.record, g.id, self.skin, start, count, slot])
            longest = int(count.numpy().max())
            if longest <= self._room:
                break
            self._room = longest + longest // 4
        contact = self.ints(slot.shape, -1)
        if self._old is not None:
            self.launch(lists.carry_contacts, n, [0, g.id, start, count, slot, self.ints(0), g.id, *self._old, contact])
        listed, touching, apart, width = self.ints(slot.shape), self.ints(n), self.ints(n), self.ints(n)
        flight = wp.zeros(0, dtype=Flight, device=g.device)
        self.launch(lists.select_contacts, n, [
            0, g.record, g.id, start, count, slot, EVERYWHERE, flight, listed, touching, apart, width
        ])  # fmt: skip
        first = _starts(touching.numpy() + apart.numpy())
        row_start = _starts(width.numpy())
        contacts, second = int(first[-1]), first[:-1] + touching.numpy()
        owner, partner, pair, slot_i, slot_j = (self.ints((contacts, 1)) for _ in range(5))
        history = wp.zeros((contacts, max(self.law.history, 1), 1), dtype=wp.float64, device=g.device)
        constants = wp.zeros((0, 1, 1), dtype=wp.float64, device=g.device)
        upload = functools.partial(wp.array, dtype=wp.int32, device=g.device)
        self._row_start = upload(row_start)
        self.launch(lists.fill_contacts, n, [
            0, g.record, g.inverse, g.material, self.law.materials, self._table, g.id, start, count, slot, listed,
            upload(first[:-1]), upload(second), self._row_start, self.history, contact, owner, partner, pair, constants,
            slot_i, slot_j, history,
        ])  # fmt: skip
        self.start, self.count, self.neighbor = start, count, slot
        self.owner, self.partner, self.history = owner, partner, history
        self._pair, self._slot_i, self._slot_j, self._old = pair, slot_i, slot_j, [start, count, slot, contact]
        self._share = wp.zeros(int(row_start[-1]) + 1, dtype=self.kernels.pair_kernels.PairForce, device=g.device)


class MeshWall(_Listed):
    """Contacts of grains with a triangle mesh at rest.

    Args:
        grains: the grains.
        law: contact law.
        mesh: a ``warpdem.mesh.triangle_mesh.TriangleMesh``, or anything with its attributes ``vertices`` (v, 3) [m],
            ``triangles`` (t, 3), ``piece`` (t,), ``plane`` (t,), ``plane_normal`` (p, 3) and ``plane_offset`` (p,) [m].
        skin: as of ``Pairs``.
        material: index of the wall's material in the contact law.

    Attributes:
        rebuilds: how often the lists of triangles near grains were made.
    """

    def __init__(self, grains: Grains, law: ContactLaw, mesh, skin: float, material: int = 0) -> None:
        super().__init__(grains, law, skin)
        device, triangles = grains.device, np.asarray(mesh.triangles, np.int32)
        corners = np.asarray(mesh.vertices, float)[triangles]
        normal, offset = mesh.plane_normal[mesh.plane], mesh.plane_offset[mesh.plane]
        height = np.einsum("tcx,tx->tc", corners, normal) - offset[:, None]
        surface = self.surface = Surface()
        surface.triangles, surface.planes, surface.revolutions, surface.spheres = len(triangles), 0, 0, 0
        surface.corner = wp.array(corners, dtype=wp.mat33d, device=device)
        surface.vertex = wp.array(triangles, dtype=wp.vec3i, device=device)
        surface.piece = wp.array(np.asarray(mesh.piece, np.int32), dtype=wp.int32, device=device)
        surface.plane = wp.array(np.concatenate([normal, offset[:, None]], axis=1), dtype=wp.vec4d, device=device)
        surface.revolved = wp.zeros(0, dtype=Revolved, device=device)
        surface.ball = wp.zeros(0, dtype=Ball, device=device)
        surface.rounding = wp.array([SEAM * np.abs(height).max()], dtype=wp.float64, device=device)
        surface.wall, surface.motion, surface.images = self.ints(len(triangles)), self.ints(1), self.ints(0)
        surface.material = self.ints(1, material)
        self._tree = wp.Mesh(
            points=wp.array(np.asarray(mesh.vertices, np.float32), dtype=wp.vec3, device=device),
            indices=wp.array(triangles.ravel(), dtype=wp.int32, device=device),
        )
        at_rest = np.zeros((1, 1, 18))
        at_rest[..., [0, 4, 8]] = 1.0
        self._placement = wp.array(at_rest, dtype=Placement, device=device)
        self._wall_contacts = self._new_wall_contacts(self.ints(len(grains) + 1), 0)

    def apply(self, dt: float) -> None:
        """Add the forces and torques of the wall on each grain to ``grains.load``, for a step of ``dt`` [s]."""
        g = self.grains
        self.update()
        row = _row(dt, (0.0, 0.0, 0.0), g.steps == 0, g.device.alias)
        if self._wall_contacts.grain is not None and len(self._wall_contacts.grain):
            self.launch(self.kernels.wall_forces, len(self._wall_contacts.grain), [
                g.record, g.inverse, g.material, self.law.materials, self._table, self.surface, self._wall_contacts,
                self._placement,
                row, g.steps & 1, dt, g.load,
            ])  # fmt: skip

    def _new_wall_contacts(self, first: wp.array, slots: int):
        """WallContacts with ``slots`` slots in all, those of each grain from ``first`` on."""
        wall_contacts, n, device = self.kernels.WallContacts(), len(self.grains), self.grains.device
        wall_contacts.first, wall_contacts.candidates = first, self.ints(n)
        wall_contacts.load = wp.zeros(n, dtype=Load, device=device)
        wall_contacts.feature, wall_contacts.hit_state, wall_contacts.hit_mask = (self.ints(slots) for _ in range(3))
        wall_contacts.hit = wp.zeros(slots, dtype=places.Hit, device=device)
        wall_contacts.result = wp.zeros(slots, dtype=self.kernels.Result, device=device)
        wall_contacts.place_count = self.ints((2, n))
        wall_contacts.place = wp.zeros((2, slots), dtype=self.kernels.Memory, device=device)
        return wall_contacts

    def _make(self) -> None:
        g, beside, n = self.grains, self.kernels.beside, len(self.grains)
        count, nothing, tree = self.ints(n), self.ints(0), wp.array([self._tree.id], dtype=wp.uint64, device=g.device)
        placements = self._placement.flatten()
        shared = [g.record, 0.5 * self.skin, self.surface, tree, self.ints(1), self.ints(1), placements]
        self.launch(beside.near_features, n, [0, 0, *shared, nothing, count, nothing])
        host = _starts(count.numpy())
        first, near = wp.array(host, dtype=wp.int32, device=g.device), self.ints(int(host[-1]))
        self.launch(beside.near_features, n, [0, 1, *shared, first, count, near])
        before, wall_contacts = self._wall_contacts, self._new_wall_contacts(first, int(host[-1]))
        same = wp.array(np.arange(n, dtype=np.int32), device=g.device)
        self.launch(beside.carry_wall_contacts, n, [0, 1 - (g.steps & 1), same, before, wall_contacts])
        flight = wp.zeros(0, dtype=Flight, device=g.device)
        self.launch(beside.close_features, n, [
            0, g.record, 0.5 * self.skin, self.surface, placements, near, flight, wall_contacts
        ])  # fmt: skip
        at_wall = np.flatnonzero(wall_contacts.candidates.numpy()).astype(np.int32)
        wall_contacts.grain = wp.array(at_wall, dtype=wp.int32, device=g.device)
        self._wall_contacts = wall_contacts


def drift(grains: Grains, dt: float, gravity=(0.0, 0.0, 0.0)) -> None:
    """Kick by the load and gravity, then drift: V += dt (F/m + g), q += dt V; the first kick is half a step.

    Args:
        grains: whose ``load`` is that of the present instant; positions are those of the next one afterwards.
        dt: time step [s], the same in all steps.
        gravity: [m/s2].
    """
    device = grains.device
    row = _row(float(dt), tuple(float(g) for g in gravity), grains.steps == 0, device.alias)
    frames, store = wp.zeros(0, dtype=FrameRow, device=device), wp.zeros((0, 0), dtype=wp.vec3d, device=device)
    numbers = wp.zeros(0, dtype=motion.Numbers, device=device)
    inputs = [grains.record, grains.load, grains.inverse, row, frames, numbers, dt, store]
    wp.launch(_motion().move, len(grains), inputs, device=device)
    grains.steps += 1
