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
and all guards. README: ``kernels/API.md``.
"""

from warpdem.kernels.api.contact_law import ContactLaw
from warpdem.kernels.api.drift import drift
from warpdem.kernels.api.grains import Grains, Record, records
from warpdem.kernels.api.mesh_wall import MeshWall
from warpdem.kernels.api.pairs import Pairs

__all__ = ["ContactLaw", "Grains", "MeshWall", "Pairs", "Record", "drift", "records"]
