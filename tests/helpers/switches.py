"""Features with some of their switches set otherwise than a scene asks for."""

from dataclasses import is_dataclass, replace

from warpdem.model.features import Features


def switched(features: Features, **changes) -> Features:
    """``features`` with changes: of a group a dict of its switches, of what stands outside of the groups the value itself."""
    groups = {name: getattr(features, name) for name in changes}
    return replace(
        features, **{name: replace(groups[name], **new) if is_dataclass(groups[name]) else new for name, new in changes.items()}
    )
