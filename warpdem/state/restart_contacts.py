"""Contact history that a scene takes over from the checkpoint that it starts from."""

from typing import Any

import numpy as np

from warpdem.kernels.contact.columns import TWIST, VECTORS, Columns, own_history
from warpdem.kernels.contact.liquid import COUNT
from warpdem.scene.model import Scene
from warpdem.scene.models import model
from warpdem.state.restart_walls import in_new_axes, wall_numbers


def kept_history(scene: Scene, data: dict[str, Any], redrawn: set[str]) -> tuple[dict[str, np.ndarray], list[str]]:
    """Arrays for ``contact_history.remember``, walls numbered as those of ``scene``, and notes on what begins at zero.

    Args:
        scene: the scene that starts.
        data: the checkpoint.
        redrawn: names of walls whose geometry is another now.
    """
    was, now, notes = data["scene"]["contact"], scene.contact, []
    springs, given = Columns(tuple((name, 3) for name in VECTORS)), data["pair_history"].shape[1]
    kept = {
        "spring": now.tangential == was["tangential"],
        "angle": (now.rolling, now.torsion) == (was["rolling"], was["torsion"]),
    }
    kept = {name: same and springs.of(name).stop <= given for name, same in kept.items()}
    pairs = np.zeros((len(data["pair"]), springs.width))
    for name in springs.names:
        if kept[name]:
            pairs[:, springs.of(name)] = data["pair_history"][:, springs.of(name)]
    law_stays = {"normal": now.normal == was["normal"], "liquid": now.liquid == was.get("liquid", "none")}
    own = {
        name: law_stays["liquid" if name.startswith(COUNT) else "normal"] and f"pair_own_{name}" in data
        for name in own_history(model("normal", scene.normal_law)).names
    }
    own[TWIST] = now.twisting == was.get("twisting") and f"pair_own_{TWIST}" in data
    roles = ("tangential", "rolling", "twisting")
    lost = [f"contact.{role}" for role in roles if getattr(now, role) != was.get(role, "none") != "none"]
    if lost:
        notes.append(f"start: springs of contacts begin at zero, since {' and '.join(lost)} differs from {data['path']}")
    out = {"id": data["id"], "pair": data["pair"], "pair_history": pairs}
    out |= {f"pair_own_{k}": data[f"pair_own_{k}"] if same else np.zeros(len(pairs)) for k, same in own.items()}
    if COUNT in own:  # what had asked for liquid asks again
        out[f"pair_own_{COUNT}"] = np.maximum(out[f"pair_own_{COUNT}"], 0.0)
    if "wall_contact_wall" not in data:
        return out, notes
    number, dropped = wall_numbers(scene, data)
    at_known = number[data["wall_contact_wall"]] >= 0
    if dropped:
        notes.append(f"start: springs at {', '.join(dropped)} begin at zero: not in this scene, or of another geometry")
    for name in ("grain", "wall", "overlap", "weight", "point", "normal"):
        out[f"wall_contact_{name}"] = data[f"wall_contact_{name}"][at_known]
    out["wall_contact_point"] = in_new_axes(scene, data, redrawn, out["wall_contact_wall"], out["wall_contact_point"])
    out["wall_contact_wall"] = number[out["wall_contact_wall"]]
    for name in springs.names:
        out[f"wall_contact_{name}"] = data[f"wall_contact_{name}"][at_known] if kept[name] else np.zeros((at_known.sum(), 3))
    for name, same in own.items():
        out[f"wall_contact_{name}"] = data[f"wall_contact_{name}"][at_known] if same else np.zeros(at_known.sum())
    if COUNT in own:
        out[f"wall_contact_{COUNT}"] = np.maximum(out[f"wall_contact_{COUNT}"], 0.0)
    return out, notes
