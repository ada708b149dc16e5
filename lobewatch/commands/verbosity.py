"""Options --quiet and --verbose, before and after the name of a command."""

import time
from typing import Any

from typer.core import TyperOption

QUIET_HELP = "Result and errors only. Instructions of tap, listen and sensors remain."
GUIDED_COMMANDS = ("tap", "listen", "sensors")
"""Commands that tell a person what to do: --quiet leaves their notes on."""
VERBOSE_HELP = "Time of each step of the main thread (s), on stderr."


def make_verbosity_options() -> list[TyperOption]:
    """Make the two options of a command."""
    return [
        TyperOption(param_decls=["-q", "--quiet"], is_flag=True, default=False, help=QUIET_HELP),
        TyperOption(param_decls=["-v", "--verbose"], is_flag=True, default=False, help=VERBOSE_HELP),
    ]


def apply_verbosity(ctx: Any, *, quiet: bool, verbose: bool) -> None:
    """Silence the notes, or measure the steps, until the context of a command is closed."""
    if not (quiet or verbose):
        return
    from lobewatch.show.terminal.output import notes
    from lobewatch.step_times import STEP_TIMES

    if quiet and (ctx.invoked_subcommand or ctx.info_name) not in GUIDED_COMMANDS:
        notes.quiet = True
        ctx.call_on_close(lambda: setattr(notes, "quiet", False))
    if verbose and STEP_TIMES.seconds is None:
        seconds, start = dict[str, float](), time.perf_counter()
        STEP_TIMES.seconds = seconds

        def print_times() -> None:
            STEP_TIMES.seconds = None
            total = time.perf_counter() - start
            steps = seconds | {"other": total - sum(seconds.values()), "total": total}
            notes.print("time:", ", ".join(f"{step} {value:.2f} s" for step, value in steps.items()))

        ctx.call_on_close(print_times)
