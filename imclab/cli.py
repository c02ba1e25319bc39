"""The ``imclab`` command: the verbs, each a thin layer over a library call.

Exit codes: 0 done; 2 bad input, told in one block on stderr; 3 hardware; 130 interrupted with what
was finished saved. Only this module prints errors, and only here does the program end.
"""

from __future__ import annotations

import os
import sys
from typing import Annotated

import typer

import imclab
from imclab.commands.bench import bench
from imclab.commands.calibrate import calibrate
from imclab.commands.gate import app as gate
from imclab.commands.particles import particles
from imclab.commands.report import report
from imclab.commands.simulate import simulate
from imclab.commands.study import study
from imclab.commands.sweep import sweep
from imclab.commands.transmit import transmit
from imclab.commands.twin import twin
from rig.interruption import interruptible

app = typer.Typer(
    name="imclab",
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
    rich_markup_mode="rich",
    context_settings={"help_option_names": ["-h", "--help"]},
)


def _print_version(wanted: bool) -> None:
    if wanted:
        print(f"imclab {imclab.__version__}")
        raise typer.Exit


@app.callback()
def _root(
    version: Annotated[
        bool, typer.Option("--version", callback=_print_version, is_eager=True, help="Print the version.")
    ] = False,
) -> None:
    """Find out whether the simulation of a range-gated underwater imaging rig can be believed."""


app.command("simulate")(simulate)
app.command("transmit")(transmit)
app.command("calibrate")(calibrate)
app.command("particles")(particles)
app.command("report")(report)
app.command("twin")(twin)
app.command("study")(study)
app.command("sweep")(sweep)
app.command("bench")(bench)
app.add_typer(gate, name="gate")


def _tell(error: BaseException, code: int) -> int:
    print(f"imclab: {error}", file=sys.stderr)
    return code


def main() -> None:
    """Run the command line; the one place that turns errors into exit codes."""
    sys.exit(run())


def run(arguments: list[str] | None = None) -> int:
    """Run one command and return its exit code.

    Parameters
    ----------
    arguments : list of str, optional
        The words after ``imclab``; those of the process when left out.
    """
    try:
        with interruptible():  # `kill` and a batch system's time limit keep what is finished, as Ctrl-C does
            outcome = app(args=arguments, standalone_mode=False)
    except (KeyboardInterrupt, typer.Abort):
        return _tell(KeyboardInterrupt("interrupted"), 130)
    except BrokenPipeError:
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 0
    except Exception as error:
        return _outcome_of(error)
    return outcome if isinstance(outcome, int) else 0


def _outcome_of(error: Exception) -> int:
    """Tell an error made on purpose and return its exit code; a fault of the program goes on."""
    code = getattr(error, "exit_code", None)
    if code is None:
        if isinstance(error, OSError) and error.filename is not None:
            return _tell(OSError(f"{error.filename}: {error.strerror}"), 2)
        raise error
    if hasattr(error, "show"):  # a mistake in the words of the command: show the usage as well
        error.show()
        return int(code)
    return _tell(error, int(code))


if __name__ == "__main__":
    main()
