"""Entry point of the program: ``python __main__.py geometry|motion|scene FILE PRIM|TIME [FOLDER ...]``.

The answer on standard output is an .npz archive whose array ``answer`` is a text in JSON: either what the file says, or
``{"refused": reason}``. With folders, no layer outside them is opened.
"""

import contextlib
import io
import json
import os
import sys
from pathlib import Path

import numpy as np

sys.path.append(str(Path(__file__).resolve().parents[3]))  # the package of the caller, wherever that imported it from

from warpdem.usd.reader.errors import Refused
from warpdem.usd.reader.geometry import read_geometry
from warpdem.usd.reader.layers import open_stage, unchosen_variants
from warpdem.usd.reader.motion import read_motion
from warpdem.usd.reader.prims import units_of
from warpdem.usd.reader.scene import read_scene


def answer(what: str, file: str, about_what: str, folders: list[str]) -> dict[str, np.ndarray]:
    """All arrays of the answer to one question."""
    from pxr import Tf

    arrays: dict[str, np.ndarray] = {}
    try:
        stage = open_stage(file, folders)
        noticed = unchosen_variants(stage)
        said, arrays = {"geometry": read_geometry, "motion": read_motion, "scene": read_scene}[what](stage, about_what)
        said |= units_of(stage)
        said["noticed"] = [*noticed, *said.get("noticed", ())]
    except Refused as refused:
        said = {"refused": str(refused)}
    except MemoryError:
        said = {"refused": "reading it takes far more memory than the file is long: damaged?"}
    except (Tf.ErrorException, RuntimeError) as error:
        try:
            text = " ".join(str(error).split())
        except UnicodeDecodeError:  # the library quotes the bytes it stumbled over
            text = "it holds bytes that are no text"
        said = {"refused": f"cannot be read as USD: {text[:400] or type(error).__name__}"}
    return {"answer": np.array(json.dumps(said)), **arrays}


def main() -> None:
    """Answer the question of the command line."""
    what, file, about_what, *folders = sys.argv[1:]
    # the answer alone goes to standard output: what libraries print goes to standard error
    with open(os.dup(1), "wb") as out:
        os.dup2(2, 1)
        held = io.BytesIO()
        with contextlib.suppress(BrokenPipeError):
            np.savez(held, **answer(what, file, about_what, folders))
            out.write(held.getbuffer())


if __name__ == "__main__":
    main()
