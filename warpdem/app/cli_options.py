"""Options that several commands take."""

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

Settings = Annotated[
    list[str],
    Parameter("--set", consume_multiple=True, help="""Change keys: --set time.end=0.5 engine.skin='"0.1 mm"'."""),
]
Plugins = Annotated[
    list[Path], Parameter("--plugin", consume_multiple=True, help="Load these .py files, which the scene names; after SCENE.")
]
AllowPaths = Annotated[
    list[Path], Parameter("--allow-path", consume_multiple=True, help="Let the scene read in these folders too; after SCENE.")
]
Picture = Annotated[
    bool | None, Parameter(help="Draw picture.png at the end, or not (it takes seconds), whatever the scene says.")
]
At = Annotated[
    float | None, Parameter("--at", help="With the result stage of a run: start from its frame at this time [s].")
]


@dataclass(frozen=True)
class AccuracyOptions:
    """What ``--accuracy`` of run and check takes."""

    accuracy: str | None = None
    """Accuracy that a measure shall have, such as 1%: step and precision are chosen by runs with three steps and by twins."""
    measure: str | None = None
    """The measure, as --results of a sweep: "drum torque y:mean@1:"."""
    short: float | None = None
    """End the runs that choose at this time [s] instead of the scene's."""
    twins: Annotated[int, Parameter("--accuracy-twins")] = 3
    """Perturbed twins of the first of these runs, which tell chance from error; 0 for none."""
    steps: Annotated[int, Parameter("--accuracy-steps")] = 3
    """Steps that these runs take: the scene's, half of it, a quarter of it ...; from 3 to 8."""
    diagram: Path | None = None
    """Draw their work-precision diagram, error against run time: .png, .svg or .pdf, with the numbers beside it as .csv."""
    trials: Path | None = None
    """Folder of these runs; out/NAME-accuracy in the present folder if not given; what is done there is not run again."""
