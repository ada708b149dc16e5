"""Help pages in plain text that fit any terminal; examples stay whole, so that they can be copied."""

from __future__ import annotations

import shutil
import textwrap
from collections.abc import Collection, Iterator, Mapping
from typing import Any

from typer.core import TyperCommand, TyperGroup

MAX_PAGE_WIDTH = 100
"""Characters a line; longer ones are hard to read."""
MAX_NAME_COLUMN_WIDTH = 30
"""Characters of the first column of a list, less on a narrow terminal."""


class HelpCommand(TyperCommand):
    """A command with such a page."""

    def format_help(self, ctx: Any, formatter: Any) -> None:
        """Write the page."""
        formatter.write(_format_page(self, ctx, formatter.width, {}))


class HelpGroup(TyperGroup):
    """A group of commands with such a page."""

    def format_help(self, ctx: Any, formatter: Any) -> None:
        """Write the page."""
        formatter.write(_format_page(self, ctx, formatter.width, self.groups(ctx)))

    def groups(self, ctx: Any) -> Mapping[str, Mapping[str, str]]:
        """Summaries of its commands under the headings of the page: the first paragraph of the help of each."""
        commands = {name: self.get_command(ctx, name) for name in self.list_commands(ctx)}
        texts = {name: (command.help or "").partition("\n\n")[0] for name, command in commands.items() if command}
        return {"Commands": texts}


def get_page_width() -> int:
    """Characters a line, here and now."""
    return min(shutil.get_terminal_size().columns, MAX_PAGE_WIDTH)


def _format_page(
    command: TyperCommand | TyperGroup, ctx: Any, width: int, groups: Mapping[str, Mapping[str, str]]
) -> str:
    rows: dict[str, list[tuple[str, str]]] = {"argument": [], "option": []}
    for parameter in command.get_params(ctx):
        record = parameter.get_help_record(ctx)
        if record is not None:
            rows[parameter.param_type_name].append(record)
    usage = " ".join(["Usage:", ctx.command_path, *command.collect_usage_pieces(ctx)])
    lines = [*_wrap_words(usage, width, subsequent_indent="  "), *_format_paragraphs(command.help or "", width)]
    for title, listed in (("Arguments", rows["argument"]), ("Options", rows["option"])):
        if listed:
            lines += ["", f"{title}:", *_format_list(listed, width, _find_longest_name(dict(listed), width))]
    longest = _find_longest_name([name for commands in groups.values() for name in commands], width)
    for title, commands in groups.items():
        lines += ["", f"{title}:", *_format_list(commands.items(), width, longest)]
    return "\n".join(lines) + "\n"


def _format_paragraphs(text: str, width: int) -> Iterator[str]:
    """Paragraphs, wrapped; those that are indented (examples) as they are."""
    for paragraph in text.split("\n\n"):
        yield ""
        yield from paragraph.splitlines() if paragraph.startswith(" ") else _wrap_words(paragraph, width)


def _find_longest_name(names: Collection[str], width: int) -> int:
    """Characters of the longest name that has its text beside it; those that are longer do not count."""
    most = min(MAX_NAME_COLUMN_WIDTH, width // 3)
    return max((len(name) for name in names if len(name) <= most), default=most)


def _format_list(rows: Collection[tuple[str, str]], width: int, longest: int) -> Iterator[str]:
    """Names and texts side by side; a name that is too long for its column above its text."""
    column = 4 + longest
    for name, text in rows:
        texts = _wrap_words(text, width - column) or [""]
        if len(name) <= longest:
            yield f"  {name:{column - 2}}{texts.pop(0)}".rstrip()
        else:
            yield from (f"  {line.replace('| ', '|')}" for line in _wrap_words(name.replace("|", "| "), width - 2))
        yield from (" " * column + line for line in texts)


def _wrap_words(text: str, width: int, subsequent_indent: str = "") -> list[str]:
    """Lines broken at spaces only: the name of an option stays whole."""
    return textwrap.wrap(
        " ".join(text.split()),
        width,
        subsequent_indent=subsequent_indent,
        break_long_words=False,
        break_on_hyphens=False,
    )
