"""Write docs/commands.md from the help of the commands: `.venv/bin/python docs/make_commands.py`."""

from __future__ import annotations

import re
import subprocess
import sys
from collections.abc import Iterable
from pathlib import Path

from lobewatch.commands import GROUPS

INTRODUCTION = """Every command with its options, made from `--help` by `docs/make_commands.py`.
The ten commands that a shop needs are in the [README](../README.md#ten-commands)."""


def page() -> str:
    """Return the page as Markdown, made from typer's own description of an application."""
    command = ["typer", "lobewatch.cli", "utils", "docs", "--name", "lobewatch", "--title", "All commands"]
    text = subprocess.run([sys.executable, "-m", *command], capture_output=True, text=True, check=True).stdout
    head, _, rest = text.partition("**Commands**:")
    rest = rest[rest.index("## `") :]
    head = head.replace("# All commands\n", f"# All commands\n\n{INTRODUCTION}\n", 1)
    listed = "\n\n".join(f"**{group}**: {_links(commands)}" for group, commands in GROUPS.items())
    examples = re.sub(r"^  (?=lobewatch )", "    ", f"{head}{listed}\n\n{rest}", flags=re.MULTILINE)
    repeated = r"^\* `(?:-h, )?--help`.*\n|^\*\*Usage\*\*:\n\n```console\n.*\n```\n\n|  \[required\]$"
    return re.sub(repeated, "", examples, flags=re.MULTILINE).rstrip() + "\n"


def _links(commands: Iterable[str]) -> str:
    return ", ".join(f"[`{name}`](#lobewatch-{name})" for name in commands)


if __name__ == "__main__":
    Path(__file__).with_name("commands.md").write_text(page(), encoding="utf-8")
