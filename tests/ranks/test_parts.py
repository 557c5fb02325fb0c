"""Who owns a place, whom a rank sees, and how grains and contacts are dealt out; against brute force."""

import pickle
import subprocess
import sys
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
import warp as wp
from warpdem.kernels import grain

from warpdem import Scene, Simulation
from warpdem.engine.host_build import morton_order
from warpdem.errors import SceneError
from warpdem.model.decisions import Decisions
from warpdem.model.prepare import without_grains
from warpdem.ranks import estimate, halo, launcher
from warpdem.ranks.cuts import Cuts
from warpdem.ranks.portion import Portion, with_ghosts
from warpdem.ranks.rank import Rank

TRANSFER = Path(__file__).parents[1] / "helpers" / "rank_transfer.py"


@pytest.fixture
def rng():
    return np.random.default_rng(3)


@pytest.mark.parametrize("parts", [1, 2, 3, 5, 8])
def test_every_point_has_one_owner_and_weights_are_even(rng, parts):
    position, weight = rng.uniform(size=(4000, 3)) * [3, 1, 1], rng.uniform(0.5, 1.5, 4000)
    cuts = Cuts.of(position, weight, parts)
    owner = cuts.owner(position)
    loads = np.bincount(owner, weight, minlength=parts)
    assert len(loads) == parts == cuts.parts
    assert loads.max() / loads.mean() < 1.01
    on_a_cut = np.tile(position[:1], (parts, 1))
    for node in range(parts - 1):
        on_a_cut[node, cuts.axis[node]] = cuts.place[node]
    assert set(cuts.owner(on_a_cut)) <= set(range(parts))


def test_around_some_grains_are_those_they_touch(rng):
    """Whole clumps, contacts of these grains, points of all; of two ranks together the same as of one that holds all."""
    ids = np.arange(40) * 3
    clump = np.where(ids // 12 % 3 == 0, ids // 12 * 12, -1)
    pair = np.unique(np.sort(rng.choice(ids, (60, 2)), axis=1), axis=0)
    pair = pair[pair[:, 0] < pair[:, 1]]
    point = np.sort(rng.choice(ids, 25))
    whole = Portion(
        {"id": ids, "clump": clump}, {"pair": pair}, {"wall_contact_grain": point}, {"id": np.unique(clump[clump >= 0])}
    )
    some = np.array([9, 36, 75])
    touches = [p for p in pair.tolist() if set(p) & set(some.tolist())]
    near = {*some.tolist(), *(one for p in touches for one in p)}
    leads = {clump[one // 3] for one in near} - {-1}
    wanted = sorted(one for one in ids.tolist() if one in near or clump[one // 3] in leads)
    parts = whole.split(np.where(clump >= 0, clump, ids) // 12 % 2, 2)
    joined = Portion.joined([part.around(some) for part in parts])
    assert len(near) < len(wanted) < len(ids) and len(touches) > 5
    for found in (whole.around(some), joined):
        assert found.grains["id"].tolist() == wanted
        assert found.pairs["pair"].tolist() == touches
        assert found.points["wall_contact_grain"].tolist() == [one for one in point.tolist() if one in wanted]
        assert set(found.clumps["id"].tolist()) == leads


def test_shifted_cuts_keep_their_axes(rng):
    position = rng.uniform(size=(1000, 3)) * [3, 1, 1]
    cuts = Cuts.of(position, np.ones(1000), 4)
    flat = position * [0.01, 1, 1]
    assert np.array_equal(Cuts.of(flat, np.ones(1000), 4, like=cuts).axis, cuts.axis)
    assert not np.array_equal(Cuts.of(flat, np.ones(1000), 4).axis, cuts.axis)


def test_cuts_of_no_points_and_of_one():
    assert Cuts.of(np.zeros((0, 3)), np.zeros(0), 3).owner(np.zeros((0, 3))).shape == (0,)
    assert np.bincount(Cuts.of(np.zeros((5, 3)), np.ones(5), 3).owner(np.zeros((5, 3))), minlength=3).sum() == 5


@pytest.mark.parametrize("period", [(0.0, 0.0, 0.0), (4.0, 0.0, 2.0)])
def test_a_rank_sees_all_that_may_come_near(rng, period):
    """No pair is missed that the lists would hold; and large grains do not make small ones seen from as far."""
    here, there = rng.uniform(size=(300, 3)) * [2, 2, 2], rng.uniform(size=(300, 3)) * [2, 2, 2] + [2, 0, 0]
    small, beyond = rng.uniform(0.04, 0.08, 300), 0.04
    mixed = small.copy()
    mixed[there[:, 0] > 3.5] *= 4.0
    for radius in (small, mixed):
        seen = halo.seen(here, small, halo.boxes(there, radius), beyond, period)
        apart = here[:, None] - there
        for k, length in enumerate(period):
            if length:
                apart[..., k] -= length * np.rint(apart[..., k] / length)
        near = (np.linalg.norm(apart, axis=-1) < small[:, None] + radius + beyond).any(axis=1)
        assert near.any()
        assert not (near & ~seen).any()
    assert halo.seen(here, small, halo.boxes(there, small), beyond, period).mean() < 0.6
    assert not halo.seen(here, small, halo.boxes(there[:0], small[:0]), beyond, period).any()


def table(rng, n=60) -> Portion:
    ids = np.sort(rng.choice(1000, n, replace=False))
    pair = np.unique(np.sort(rng.choice(ids, (80, 2)), axis=1), axis=0)
    pair = pair[pair[:, 0] < pair[:, 1]]
    held = np.sort(rng.choice(ids, 30))
    return Portion(
        {"id": ids, "record": rng.uniform(size=(n, 16))},
        {"pair": pair, "pair_history": rng.uniform(size=(len(pair), 3))},
        {"wall_contact_grain": held, "wall_contact_spring": rng.uniform(size=(30, 3))},
    )


def test_what_is_dealt_out_comes_together_again(rng):
    whole = table(rng)
    for parts in (1, 2, 5):
        owner = rng.integers(0, parts, len(whole))
        dealt = whole.split(owner, parts)
        assert sum(map(len, dealt)) == len(whole)
        again = Portion.joined(dealt[::-1])  # contacts across come twice
        assert all(np.array_equal(again.data[name], values) for name, values in whole.data.items())
        for one in dealt:
            one.keep_owned_pairs()
        assert sum(len(one.pairs["pair"]) for one in dealt) == len(whole.pairs["pair"])


def test_what_goes_block_by_block_is_what_goes_at_once():
    """Between three processes, one of which gets nothing; contacts across come to both sides, and again from one."""
    pytest.importorskip("mpi4py")
    begin, environment = launcher.command(3)
    done = subprocess.run([*begin, sys.executable, TRANSFER], env=environment, capture_output=True, text=True, timeout=300)
    assert done.returncode == 0, done.stderr
    assert done.stdout.startswith("500 grains")


def test_ghosts_stand_behind_own_grains(rng):
    whole = table(rng)
    mine, other = whole.split((np.arange(len(whole)) % 3 == 0).astype(int), 2)
    given = {name: values[::-1] for name, values in other.grains.items()}
    both, place = with_ghosts(mine.grains, [given])
    assert np.array_equal(both["id"], whole.grains["id"])
    assert np.array_equal(both["id"][place], np.concatenate([mine.grains["id"], given["id"]]))
    among = mine.among(mine.grains["id"])
    assert np.isin(among["pair"], mine.grains["id"]).all()
    assert len(among["pair"]) < len(mine.pairs["pair"])


@pytest.mark.parametrize("clumps", [False, True])
def test_grains_that_others_see_stand_last(rng, clumps):
    """Those before them are evaluated while ghosts are under way; both in the order of space, clumps whole."""
    n, radius, gap, skin = 300, 0.05, 0.01, 0.02
    position = rng.uniform(size=(n, 3))
    record = np.zeros((n, grain.WIDTH[True]))
    record[:, grain.POSITION], record[:, grain.RADIUS] = position, radius
    table = {"record": record, "inverse": np.zeros((n, 2)), "id": np.arange(n) * 2, "material": np.zeros(n, dtype=np.int32)}
    mine = Portion(table, {}, {})
    body = np.arange(n)
    if clumps:
        body[1::3] -= 1  # of every three one is alone
        mine.grains["clump"] = np.where(np.arange(n) % 3 < 2, table["id"][body], -1)
        mine.clumps = {"id": table["id"][np.arange(0, n, 3)]}
    others = [np.array([[1.0 + radius, 0.3, 0.3]]), np.array([[0.2, -radius, 0.2], [0.8, -radius, 0.8]])]
    boxes = [halo.boxes(there, np.full(len(there), radius)) for there in others]
    given = {}

    def swapped(out):
        given.update(enumerate(out))
        return [None] * 3

    world = SimpleNamespace(rank=0, size=3, everyone=lambda own: [own, *boxes], swapped=swapped)
    features = SimpleNamespace(contact=SimpleNamespace(gap=gap))
    model = SimpleNamespace(features=features, domain=SimpleNamespace(period=np.zeros(3)), device=wp.get_device("cpu"))
    rank = SimpleNamespace(world=world, _model=model, lists=SimpleNamespace(skin=skin))
    order, sends, _, _, _ = Rank._with_ghosts(rank, mine)
    seen = np.zeros(n, dtype=bool)
    for number, slots in sends.items():
        assert np.array_equal(given[number]["id"], table["id"][order[slots]])
        seen[order[slots]] = True
    assert sends.keys() == {1, 2} and 0 < seen.sum() < n / 2
    last = np.isin(body, body[seen])[order]
    assert clumps == (last.sum() > seen.sum())
    assert last[-last.sum() :].all()
    inside = morton_order(mine.places, 2 * radius + gap + skin, model.device)
    for part in (last, ~last):
        assert np.array_equal(order[part], inside[np.isin(inside, order[part])])


def test_what_is_sent_to_all_ranks_does_not_grow_with_the_grains():
    """Positions, radii, velocities, spins and ids of a scene are dealt out, not sent to all; the model is the same."""
    sizes = []
    for n in (10, 16):
        place = np.stack(np.meshgrid(*[np.arange(n)] * 3), axis=-1).reshape(-1, 3) * 3e-3
        rows = {"positions": place, "velocities": 0.1 * place, "spins": place, "radii": np.full(n**3, 1e-3)}
        given = {"materials": {"a": {"density": 2500, "young_modulus": 5e6, "poisson_ratio": 0.3}},
                 "pairs": [{"materials": ["a", "a"], "restitution": 0.5, "friction": 0.3}],
                 "grains": [{"material": "a", "ids": np.arange(n**3) + 5, **rows}],
                 "time": {"end": 1.0, "max_speed": 1.0}}  # fmt: skip
        model = Simulation(Scene.model_validate(given), device="cpu", threads=1).model
        decided = Decisions.of(model)
        sizes.append(len(pickle.dumps(decided)))
        again = without_grains(pickle.loads(pickle.dumps(decided)), model.device)
        assert again.features == model.features and again.scene.groups == model.scene.groups
    assert model.scene.grains[0].positions is not None and model.given.json
    assert abs(sizes[1] - sizes[0]) < 1000 < sizes[0] < 100_000


def test_the_launcher_is_known_by_its_variables(monkeypatch):
    for name in launcher.SIZES:
        monkeypatch.delenv(name, raising=False)
    assert launcher.launched({}) == 1
    assert launcher.launched({"PMI_SIZE": "4", "PMI_RANK": "1"}) == 4
    assert launcher.launched({"SLURM_NTASKS": "8"}) == 1  # of a batch job, not of srun within it
    assert launcher.without_launcher({"PMI_SIZE": "4", "HOME": "/"}) == {"HOME": "/"}
    assert launcher.join() is None


def test_the_estimate_counts_what_brute_force_does(rng):
    position, radius, skin = rng.uniform(size=(500, 3)) * [4, 1, 1], np.full(500, 0.03), 0.02
    contact, domain = SimpleNamespace(gap=0.0, spins=True, clumps=False), SimpleNamespace(period=(0.0, 0.0, 0.0))
    model = SimpleNamespace(features=SimpleNamespace(contact=contact), domain=domain)
    ranks = estimate.estimate(model, position, radius, skin, 2)
    cut = np.sort(position[:, 0])[250]
    low, high = (position[side] for side in (position[:, 0] < cut, position[:, 0] >= cut))
    reach = 0.03 + 0.03 + skin
    ghosts = [int((high[:, 0] < low[:, 0].max() + reach).sum()), int((low[:, 0] > high[:, 0].min() - reach).sum())]
    assert [rank["grains"] for rank in ranks] == [250, 250]
    for rank, flat in zip(ranks, ghosts, strict=True):  # the box has edges: those off them are a few less
        assert 0.8 * flat <= rank["ghosts"] <= flat
    assert [rank["bytes"] for rank in ranks] == [rank["ghosts"] * 128 for rank in reversed(ranks)]
    assert "2 ranks" in estimate.text(ranks)


def test_one_process_loads_no_mpi():
    code = "import sys, warpdem.app.cli, warpdem.simulation; sys.exit('mpi4py' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code]).returncode == 0


def test_a_launcher_of_another_mpi_is_refused(monkeypatch):
    """Each process would be rank 0 of 1, and all would write into one folder."""
    pytest.importorskip("mpi4py")
    monkeypatch.setenv("PMI_SIZE", "3")
    with pytest.raises(SceneError, match="started 3 processes, but each of them is alone"):
        launcher.join()
