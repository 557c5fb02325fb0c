"""Features with some of their switches set otherwise than a scene asks for."""

from dataclasses import is_dataclass, replace

from warpdem import Simulation
from warpdem.model.choose_features import choose_features
from warpdem.model.features import Features


def switched(features: Features, **changes) -> Features:
    """``features`` with changes: of a group a dict of its switches, of what stands outside of the groups the value itself."""
    groups = {name: getattr(features, name) for name in changes}
    return replace(
        features, **{name: replace(groups[name], **new) if is_dataclass(groups[name]) else new for name, new in changes.items()}
    )


def in_lanes(of, lanes: int, monkeypatch, threads: int = 1) -> Simulation:
    """Run of the scene ``of`` on the CPU with registers of ``lanes`` numbers; 1: every contact and clump by itself."""

    def choose(*arguments, **more):
        return switched(choose_features(*arguments, **more), backend={"lanes": lanes})

    with monkeypatch.context() as changed:
        changed.setattr("warpdem.model.prepare.choose_features", choose)
        sim = Simulation(of, device="cpu", threads=threads)
    assert sim.plan.backend.lanes == lanes
    return sim
