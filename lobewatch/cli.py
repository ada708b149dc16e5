"""The command line: one command a module in lobewatch/commands; errors in one sentence, exit code 2."""

from __future__ import annotations

import io
import os
import sys
from importlib.metadata import version
from typing import Annotated

import typer
from rich.markup import escape

from lobewatch.commands.calibrate import calibrate
from lobewatch.commands.check import check
from lobewatch.commands.demo import demo
from lobewatch.commands.emulate import emulate
from lobewatch.commands.init import init
from lobewatch.commands.lobes import lobes
from lobewatch.commands.model import model
from lobewatch.commands.modes import modes
from lobewatch.commands.ports import ports
from lobewatch.commands.replay import replay
from lobewatch.commands.report import report
from lobewatch.commands.sensors import sensors
from lobewatch.commands.serve import serve
from lobewatch.commands.tap import tap
from lobewatch.show.output import notes, results

app = typer.Typer(
    help="Tap test in, stability lobes out: which cuts stop being safe as a spindle ages.",
    no_args_is_help=True,
    rich_markup_mode="rich",
    pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["-h", "--help"]},
)
for command in (demo, init, ports, sensors, tap, replay, modes, model, calibrate, lobes, check, report, serve):
    app.command()(command)
app.add_typer(emulate, name="emulate")


def _version(wanted: bool) -> None:
    if wanted:
        results.print(f"lobewatch {version('lobewatch')}")
        raise typer.Exit


@app.callback()
def _options(
    _debug: Annotated[bool, typer.Option("--debug", help="Show the traceback of an error.")] = False,
    _show_version: Annotated[
        bool, typer.Option("--version", callback=_version, is_eager=True, help="Show the version.")
    ] = False,
) -> None:
    pass


def main() -> None:
    """Run; exit codes: 0 fine, 1 a program is not stable (check), 2 wrong use, bad file or no device, 130 Ctrl-C."""
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors="replace")  # a console without these characters shows "?" instead
    try:
        app()
    except BrokenPipeError:
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        sys.exit(1)
    except (ValueError, OSError, ArithmeticError) as error:
        if "--debug" in sys.argv:
            raise
        notes.print("[bold red]error:[/]", escape(_sentence(error)))
        sys.exit(2)


def _sentence(error: Exception) -> str:
    """The error with the name of its file, for the errors of the operating system."""
    if isinstance(error, OSError) and error.filename and error.strerror:
        return f"{error.filename}: {error.strerror}"
    return str(error)


if __name__ == "__main__":
    main()
