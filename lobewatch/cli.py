"""Run the command line: import each command when it is needed, and print errors as one sentence."""

import atexit
import gc
import inspect
import io
import os
import signal
import sys
import threading
from collections.abc import Iterator, Mapping, MutableMapping
from importlib import import_module
from typing import Annotated, Any, cast

import typer

from lobewatch.commands import COMMANDS, GROUPS
from lobewatch.commands.help_page import HelpCommand, HelpGroup, get_page_width
from lobewatch.commands.verbosity import QUIET_HELP, VERBOSE_HELP, apply_verbosity
from lobewatch.foreign_packages import ForeignPackageError, refuse_foreign_packages

GC_THRESHOLD = 100_000
"""Number of new objects between two garbage collections. Imports make 200 000 objects that stay."""


class _LazyCommands(Mapping[str, Any]):
    """Commands by name. Reading one imports it."""

    def __getitem__(self, name: str) -> Any:
        if name not in COMMANDS:
            raise KeyError(name)
        if name != "doctor":
            refuse_foreign_packages()
        command = getattr(import_module(f"lobewatch.commands.{name}"), name)
        holder = typer.Typer(rich_markup_mode=None)
        if isinstance(command, typer.Typer):
            for registered in command.registered_commands:
                registered.cls = HelpCommand
            holder.add_typer(command, name=name, cls=HelpGroup)
        else:
            holder.command(name, cls=HelpCommand, help=_help_text(name, command))(command)
        return typer.main.get_group(holder).commands[name]

    def __iter__(self) -> Iterator[str]:
        return iter(COMMANDS)

    def __len__(self) -> int:
        return len(COMMANDS)


def _help_text(name: str, command: Any) -> str:
    """Compose the help of a command from its summary and the rest of its docstring."""
    details = (inspect.getdoc(command) or "").partition("\n\n")[2]
    return f"{COMMANDS[name]}\n\n{details}".replace("\nExamples\n--------\n", "\nExamples:\n\n").rstrip()


class _RootGroup(HelpGroup):
    """Group of all commands, which imports none before it is needed."""

    def __init__(self, **settings: Any) -> None:
        super().__init__(**settings)
        self.commands = cast(MutableMapping[str, Any], _LazyCommands())

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:
        """Skip the options of the group if a command comes first: their parser is slow to import."""
        if args and args[0][:1].isalnum():
            self.resolve_command(ctx, args)
            self.params = []
        return super().parse_args(ctx, args)

    def resolve_command(self, ctx: Any, args: list[str]) -> tuple[str | None, Any, list[str]]:
        """Find the command; `help COMMAND` stands for `COMMAND --help`."""
        if args[0] != "help":
            return super().resolve_command(ctx, args)
        if named := [word for word in args[1:] if word not in ("help", "--help")]:
            return super().resolve_command(ctx, [*named, "--help"])
        typer.echo(ctx.get_help())
        raise typer.Exit

    def list_commands(self, ctx: Any) -> list[str]:  # noqa: ARG002  (used by shell completion)
        return list(COMMANDS)

    def groups(self, ctx: Any) -> Mapping[str, Mapping[str, str]]:  # noqa: ARG002
        return GROUPS


app = typer.Typer(
    cls=_RootGroup,
    help="Tap tests and stability lobes: find cuts that become unstable as a spindle ages.\n\n"
    "lobewatch help COMMAND shows the options of a command.",
    no_args_is_help=True,
    rich_markup_mode=None,
    pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["-h", "--help"]},
)


def _print_version(is_requested: bool) -> None:
    if is_requested:
        from importlib.metadata import version

        typer.echo(f"lobewatch {version('lobewatch')}")
        raise typer.Exit


@app.callback()
def _root_options(
    ctx: typer.Context,
    quiet: Annotated[bool, typer.Option("-q", "--quiet", help=QUIET_HELP)] = False,
    verbose: Annotated[bool, typer.Option("-v", "--verbose", help=VERBOSE_HELP)] = False,
    _debug: Annotated[bool, typer.Option("--debug", help="Show the traceback of an error.")] = False,
    _show_version: Annotated[
        bool, typer.Option("--version", callback=_print_version, is_eager=True, help="Show the version.")
    ] = False,
) -> None:
    apply_verbosity(ctx, quiet=quiet, verbose=verbose)


def main() -> None:
    """Run a command. Exit codes: 0 success, 1 not everything is stable, 2 error, 130 interrupted."""
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # threads on small matrices mostly wait for each other
    gc.set_threshold(GC_THRESHOLD)
    atexit.register(gc.freeze)  # no garbage collection at the end
    if threading.current_thread() is threading.main_thread():
        signal.signal(signal.SIGTERM, signal.default_int_handler)  # SIGTERM ends a service like Ctrl-C
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors="replace")  # show "?" for characters that the console lacks
    try:
        from acquisition.credentials import hide_arguments

        hide_arguments()
        app(terminal_width=get_page_width())
    except BrokenPipeError:
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        sys.exit(1)
    except Exception as error:
        if "--debug" in sys.argv:
            raise
        if isinstance(error, ForeignPackageError):
            sys.stderr.write(f"error: {error}\n")
            sys.exit(2)
        from rich.markup import escape

        from acquisition.errors import format_error
        from lobewatch.show.terminal.output import notes

        notes.print("[bold red]error:[/]", escape(format_error(error)))
        sys.exit(2)


if __name__ == "__main__":
    main()
