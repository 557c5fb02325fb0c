"""Options that several commands take."""

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
