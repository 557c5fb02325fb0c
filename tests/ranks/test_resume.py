"""Ranks that go on from a checkpoint: contacts go from its file to them in blocks; in the ranks of this process alone."""

import h5py
import pytest

pytest.importorskip("mpi4py")

from mpi4py import MPI

from rank_scenes import SCENES
from warpdem import Simulation
from warpdem.ranks import transfer
from warpdem.ranks.front import leading
from warpdem.ranks.world import World
from warpdem.state import checkpoint, checkpoint_file


@pytest.mark.parametrize(("name", "steps"), [("stirred", 60), ("soaked", 60), ("clumped", 300)])
def test_contacts_go_to_the_ranks_in_blocks(name, steps, tmp_path, monkeypatch):
    """Rank 0 makes no list of them, until it gathers the whole to be read."""
    straight = Simulation(SCENES[name](), device="cpu", threads=1)
    straight.step(steps)
    straight.save_checkpoint(tmp_path / "saved.h5")
    largest, read = {}, h5py.Dataset.__getitem__

    def noted(data, *key):
        found = read(data, *key)
        largest[data.name] = max(found.nbytes, largest.get(data.name, 0))
        return found

    monkeypatch.setattr(transfer, "BLOCK", 128)
    monkeypatch.setattr(h5py.Dataset, "__getitem__", noted)
    world = World(MPI.COMM_SELF)
    with leading(world), checkpoint_file.opened(tmp_path / "saved.h5") as saved:
        sim = Simulation(SCENES[name](), device="cpu", threads=1, world=world)
        largest.clear()  # what was read for the digest of the file
        checkpoint.restore(sim, saved)
        assert not sim.lists.contact_count and sim.loop.rank.lists.contact_count > 5
        found = max(largest["/pair_history"], largest["/pair_share_i"])
        assert found <= 128 < saved["pair_share_i"].nbytes
        assert len(sim.state) == len(straight.state)
        sim.step(40)
        straight.step(40)
        sim.prepare()
        assert sim.state_hash() == straight.state_hash()
        assert sim.lists.contact_count
