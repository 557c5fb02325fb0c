"""What dealing a scene out to ranks would cost, from where its grains are: ghosts, and bytes at every step."""

from typing import Any

import numpy as np

from warpdem.kernels import clump, grain
from warpdem.model.model import Model
from warpdem.ranks import halo
from warpdem.ranks.cuts import Cuts


def estimate(model: Model, position: np.ndarray, radius: np.ndarray, skin: float, ranks: int) -> list[dict[str, Any]]:
    """Grains, ghosts and bytes that each rank sends per step of one stage, with cuts into equal numbers of grains.

    Args:
        model: what is run.
        position: of the grains [m], shape (n, 3).
        radius: of the grains [m], shape (n,).
        skin: of the lists [m].
        ranks: number of ranks.
    """
    owner = Cuts.of(position, np.ones(len(radius)), ranks).owner(position)
    beyond = model.features.contact.gap + skin
    boxes = [halo.boxes(position[owner == rank], radius[owner == rank]) for rank in range(ranks)]
    seen = np.array([halo.seen(position, radius, there, beyond, model.domain.period) & (owner != rank)
                     for rank, there in enumerate(boxes)]).reshape(ranks, -1)  # fmt: skip
    contact = model.features.contact
    width = 8 * (grain.WIDTH[contact.spins] + (clump.WIDTH[True] if contact.clumps else 0))
    return [
        {"grains": int((owner == rank).sum()), "ghosts": int(seen[rank].sum()),
         "bytes": width * int(seen[:, owner == rank].sum())}
        for rank in range(ranks)
    ]  # fmt: skip


def text(ranks: list[dict[str, Any]]) -> str:
    """``estimate`` for people."""
    grains, ghosts = (sum(rank[name] for rank in ranks) for name in ("grains", "ghosts"))
    most = max(rank["bytes"] for rank in ranks)
    share = ghosts / max(grains, 1)
    return (
        f"{len(ranks)} ranks, as the grains are placed: {grains // len(ranks)} grains each, {share:.1%} ghosts, up to "
        f"{most / 1e3:.3g} kB sent per step and stage"
    )
