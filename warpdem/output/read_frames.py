"""Opens the frames of a folder of results, in whichever format they are there."""

from pathlib import Path

from warpdem.errors import WarpdemError
from warpdem.output.read_vtk import Results, read_results
from warpdem.output.read_vtkhdf import VtkhdfResults, read_vtkhdf
from warpdem.output.write_vtk import INDEX
from warpdem.output.write_vtkhdf import GRAINS

AnyResults = Results | VtkhdfResults


def frames_of(folder: Path) -> AnyResults:
    """The frames in a folder.

    Raises:
        WarpdemError: There are none, or they cannot be read.
    """
    below = folder / "results"  # where a demo has them
    here, there = (any((at / name).exists() for name in (GRAINS, INDEX)) for at in (folder, below))
    if there and not here:
        raise WarpdemError(f"{folder}: the results are in {below}; give that folder")
    return read_vtkhdf(folder) if (folder / GRAINS).exists() and not (folder / INDEX).exists() else read_results(folder)
