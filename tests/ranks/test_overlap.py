"""Contacts that are evaluated while ghosts are under way, and those that wait for them; in the ranks of this process alone."""

import itertools

import pytest

pytest.importorskip("mpi4py")

from mpi4py import MPI
from warpdem.kernels.step.exchange import ARRIVED

from rank_scenes import SCENES
from warpdem import Simulation
from warpdem.ranks.exchange import Exchange
from warpdem.ranks.front import leading
from warpdem.ranks.lists import RankLists
from warpdem.ranks.world import World


@pytest.mark.parametrize("threads", [1, 2])
@pytest.mark.parametrize(("name", "stages"), [("stirred", 1), ("sizes", 4)])
def test_bits_do_not_depend_on_which_contacts_wait_for_ghosts(name, stages, threads, monkeypatch):
    """Half of them do; in each force call thread 0 waits once, after the contact batches without ghosts."""
    straight = Simulation(SCENES[name](), device="cpu", threads=1)
    straight.step(60)
    calls, inside = [], []
    call, count = Exchange.call, RankLists._count

    def noted(exchange, step, stage, found):
        calls.append(stage)
        return call(exchange, step, stage, found)

    def halved(lists):
        count(lists)
        assert lists.batches_inside == lists.totals[0] // lists.model.features.backend.lanes  # no ghosts
        lists.batches_inside //= 2
        inside.append(lists.batches_inside)

    monkeypatch.setattr(Exchange, "call", noted)
    monkeypatch.setattr(RankLists, "_count", halved)
    world = World(MPI.COMM_SELF)
    with leading(world):
        sim = Simulation(SCENES[name](), device="cpu", threads=threads, world=world)
        sim.step(60)
        sim.prepare()
        assert sim.state_hash() == straight.state_hash()
    assert max(inside) > 1
    stops = sum(a >= 0 and b >= 0 for a, b in itertools.pairwise(calls))
    waits = calls.count(ARRIVED)
    assert sum(stage >= 0 for stage in calls) == 60 * stages
    assert 40 * stages < waits and 60 * stages - 1 <= waits + stops <= 60 * stages
    assert all(before >= 0 for before, stage in itertools.pairwise(calls) if stage == ARRIVED)
