"""A stand-in for ``warpdem run``, which takes no time: makes the files of a run, or ends as it is told by the scene's title.

    python stand_in.py SCENE --out DIR ... --set title=WHAT ...

WHAT: "ok", "crash" (killed, once), "always" (killed), "stop" (code 3), "wrong" (code 2), "slow" (0.5 s). Its folder gets a line
in ``calls`` for each call: when it began and ended, and its options.
"""

import json
import os
import signal
import sys
import time
from pathlib import Path


def main() -> None:
    arguments = sys.argv[1:]
    folder = Path(arguments[arguments.index("--out") + 1])
    folder.mkdir(parents=True, exist_ok=True)
    title = next(word.partition("=")[2] for word in arguments if word.startswith("title="))
    begin = time.time()
    earlier = (folder / "calls").read_text() if (folder / "calls").exists() else ""
    (folder / "calls").write_text(earlier + json.dumps([begin, 0.0, arguments]) + "\n")
    if title == "wrong":
        print("error: grains overlap", file=sys.stderr)
        sys.exit(2)
    time.sleep(0.2)  # kernels are compiled
    record = {"status": "running", "seconds": {"total": 1.5}}
    (folder / "run.json").write_text(json.dumps(record))
    (folder / "checkpoint.h5").write_text("")
    if title == "slow":
        signal.signal(signal.SIGTERM, lambda *_: sys.exit(130))
        time.sleep(0.5)
    if title == "always" or (title == "crash" and not earlier):
        os.kill(os.getpid(), signal.SIGKILL)
    if title == "stop":
        (folder / "run.json").write_text(json.dumps(record | {"status": "stopped itself"}))
        print("error: stopped", file=sys.stderr)
        sys.exit(3)
    (folder / "history.csv").write_text(f"time [s],kinetic [J]\n0,1\n1,{int(folder.name)}\n")
    (folder / "run.json").write_text(json.dumps(record | {"status": "done", "state_hash": f"hash {folder.name}"}))
    (folder / "calls").write_text(earlier + json.dumps([begin, time.time(), arguments]) + "\n")


if __name__ == "__main__":
    main()
