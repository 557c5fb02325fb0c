"""The command ``warpdem`` and its parts."""

import sys
from collections.abc import Callable
from typing import Literal

from cyclopts import App, Parameter

from warpdem.app import cli_calibrate, cli_results, cli_scenes, cli_sweep
from warpdem.core.command import run_command

app = App(
    name="warpdem",
    help="Discrete element method for granular flow in rotating and moving equipment.",
    suppress_keyboard_interrupt=False,  # run_command() reports how to continue
    default_parameter=Parameter(negative_iterable=()),  # no --empty-set, which an option left out says as well
)


def completion(shell: Literal["bash", "zsh", "fish", "powershell"], /) -> None:
    """Print what a shell needs to complete commands and options, for its start-up file: eval "$(warpdem completion bash)".

    Args:
        shell: Shell that is to complete them.
    """
    sys.stdout.write(app.generate_completion(prog_name="warpdem", shell=shell) + "\n")


COMMANDS: dict[str, Callable[..., None]] = {
    "run": cli_scenes.run, "check": cli_scenes.check, "convert": cli_scenes.convert, "schema": cli_scenes.schema,
    "demo": cli_scenes.demo, "render": cli_results.render, "plot": cli_results.plot, "report": cli_results.report,
    "compare": cli_results.compare, "export": cli_results.export, "grains": cli_results.grains, "sweep": cli_sweep.sweep,
    "calibrate": cli_calibrate.calibrate,
    "completion": completion,
}  # fmt: skip
for name, command in COMMANDS.items():
    app.command(command, name=name)


def main() -> None:
    """The command, for programs that have imported this; exit codes as ``warpdem.core.command.run_command``."""
    run_command(lambda: app)


if __name__ == "__main__":
    main()
