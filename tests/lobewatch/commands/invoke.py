"""Invoke a command in this process; errors name options, as at the terminal."""

from __future__ import annotations

from collections.abc import Sequence

from typer.testing import CliRunner, Result

from lobewatch.cli import app
from lobewatch.show.terminal.option_names import with_option_names


def invoke(words: Sequence[str]) -> Result:
    """Run a command, and raise its errors with option names."""
    try:
        return CliRunner().invoke(app, words, catch_exceptions=False)
    except (ValueError, OSError) as error:
        error.args = (with_option_names(str(error)),)
        raise
