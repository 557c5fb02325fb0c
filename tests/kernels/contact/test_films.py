"""Films that give to bridges and get back, on arrays: whole counts, none lost, none below zero."""

import numpy as np
import pytest
import warp as wp
from warpdem.kernels.contact import films, law, pairs
from warpdem.kernels.contact.liquid import joined
from warpdem.kernels.liquid import bridge
from warpdem.kernels.normal import hertz
from warpdem.kernels.step import border

MOST = 1e9


@pytest.fixture(scope="module", params=[wp.float64, wp.float32], ids=["double", "single"])
def exchange(request):
    real, normal = request.param, joined(hertz, bridge, False)
    of = law.build(real, normal, None, None, False)
    made = pairs.build(real, of, None, border.build((0.0,) * 3, (0.0,) * 3), spins=False, gap=0.0)
    built = films.build(made, bridge, table=False, reach=1.0, longest=1.0)

    @wp.kernel(enable_backward=False, module="unique")
    def kernel(
        start: wp.array(dtype=wp.int32), most: wp.float64, row: wp.array(dtype=made.PairForce),
        film: wp.array2d(dtype=wp.int64),
    ):  # fmt: skip
        i = wp.tid()
        built.exchange(i, wp.float64(1.0), start[i], start[i + 1], most, row, film)

    def call(rows: list[list[tuple[float, float]]], film: list[list[int]], most: float = MOST):
        """Answers to the wishes in the rows (wish, gift) of each grain, and the films."""
        start = np.concatenate([[0], np.cumsum([len(row) for row in rows])])
        given = np.zeros((start[-1], made.PairForce._length_))
        given[:, 3:5] = [pair for row in rows for pair in row]
        on = [wp.array(start, dtype=wp.int32, device="cpu"), wp.array(given, dtype=made.PairForce, device="cpu")]
        out = wp.array(np.array(film), dtype=wp.int64, device="cpu")
        wp.launch(kernel, len(rows), [on[0], most, on[1], out], device="cpu")
        answers = on[1].numpy()[:, 3].astype(np.int64)
        return np.split(answers, start[1:-1]), out.numpy()

    return call


def test_a_film_gives_what_its_partner_covers_and_gets_its_gifts_first(exchange):
    (first, second, idle), film = exchange([[(1.0, 0.0)], [(0.0, 500.0), (3.0, 0.0)], [(0.0, 0.0)]], [[10_000, 0, 0]] * 3)
    assert first.tolist() == [2 * int(10_000 * (1 - np.sqrt(0.75)) / 4)], "6.7 % of a film for an equal sphere"
    assert second.tolist() == [0, 2 * int(10_500 * (1 - np.sqrt(1 - (3 / 4) ** 2)) / 4)]
    assert idle.tolist() == [0]
    assert film[:, 0].tolist() == [10_000 - first[0], 10_500 - second[1], 10_000]


def test_what_was_returned_counts_as_a_gift(exchange):
    answers, film = exchange([[(1.0, 0.0)]], [[0, 10_000, -7]])
    assert film[0].tolist() == [10_000 - answers[0][0], 0, -7] and answers[0][0] > 0


def test_more_wishes_than_there_is_liquid_and_bounds(exchange):
    wishes = [(1e6, 0.0)] * 5  # each wants half of the film
    answers, film = exchange([wishes], [[1001, 0, 0]])
    assert (answers[0] == 200).all() and film[0, 0] == 1
    answers, film = exchange([[(1e6, 0.0)]], [[10_001, 0, 0]], most=100.0)
    assert answers[0][0] == 100 and film[0, 0] == 9_901
    answers, film = exchange([[(1e6, 0.0)]], [[3, 0, 0]])
    assert answers[0][0] == 0 and film[0, 0] == 3, "half of 3 holds no even number but 0"


def test_no_count_is_lost_over_many_exchanges(exchange):
    rng = np.random.default_rng(3)
    film, total, held = [[int(x), 0, 0] for x in rng.integers(0, 10**6, 40)], 0, []
    total = sum(f[0] for f in film)
    for _ in range(60):
        rows = []
        for i in range(40):
            given = [h for grain, h in held if grain == i]
            rows.append([(float(w), 0.0) for w in rng.uniform(0.2, 5.0, rng.integers(0, 4))] + [(0.0, g) for g in given])
        held = []
        answers, film = exchange([row or [(0.0, 0.0)] for row in rows], film)
        held = [(i, int(a)) for i, row in enumerate(answers) for a in row if a]
        for i, row in enumerate(rows):  # answers stand where wishes stood; gifts that stay are no answers
            assert len(answers[i]) == max(len(row), 1)
        film = [list(map(int, f)) for f in film]
        assert min(f[0] for f in film) >= 0
        assert sum(f[0] for f in film) + sum(h for _, h in held) == total
