"""Entry point of the program: ``python __main__.py geometry|motion|scene FILE PRIM|TIME [FOLDER ...]``.

The answer on standard output is an .npz archive whose array ``answer`` is a text in JSON: either the content of the file, or
``{"refused": reason}``. If folders are given, no layer outside them is opened.
"""

import contextlib
import io
import json
import os
import sys
from pathlib import Path

import numpy as np

sys.path.append(str(Path(__file__).resolve().parents[3]))  # the package that the caller has imported

from warpdem.usd.reader.errors import Refused
from warpdem.usd.reader.geometry import read_geometry
from warpdem.usd.reader.layers import open_stage, unselected_variants
from warpdem.usd.reader.motion import read_motion
from warpdem.usd.reader.prims import stage_units
from warpdem.usd.reader.scene import read_scene


def answer(what: str, file: str, target: str, folders: list[str]) -> dict[str, np.ndarray]:
    """All arrays of the answer to one request."""
    from pxr import Tf

    arrays: dict[str, np.ndarray] = {}
    try:
        stage = open_stage(file, folders)
        noticed = unselected_variants(stage)
        content, arrays = {"geometry": read_geometry, "motion": read_motion, "scene": read_scene}[what](stage, target)
        content |= stage_units(stage)
        content["noticed"] = [*noticed, *content.get("noticed", ())]
    except Refused as refused:
        content = {"refused": str(refused)}
    except MemoryError:
        content = {"refused": "reading it needs far more memory than the size of the file: damaged?"}
    except (Tf.ErrorException, RuntimeError) as error:
        try:
            text = " ".join(str(error).split())
        except UnicodeDecodeError:  # the library quotes the invalid bytes
            text = "it holds bytes that are no text"
        content = {"refused": f"cannot be read as USD: {text[:400] or type(error).__name__}"}
    return {"answer": np.array(json.dumps(content)), **arrays}


def main() -> None:
    """Answer the request of the command line."""
    what, file, target, *folders = sys.argv[1:]
    # only the answer goes to standard output; output of libraries goes to standard error
    with open(os.dup(1), "wb") as out:
        os.dup2(2, 1)
        buffer = io.BytesIO()
        with contextlib.suppress(BrokenPipeError):
            np.savez(buffer, allow_pickle=False, **answer(what, file, target, folders))
            out.write(buffer.getbuffer())


if __name__ == "__main__":
    main()
