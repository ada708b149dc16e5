"""Format help pages as plain text, with examples that can be copied."""

import shutil
import textwrap
from collections.abc import Collection, Iterator, Mapping
from typing import Any

from typer.core import TyperCommand, TyperGroup

from lobewatch.commands.verbosity import apply_verbosity, make_verbosity_options

MAX_PAGE_WIDTH = 100
"""Characters in a line at most; longer lines are hard to read."""
MAX_NAME_COLUMN_WIDTH = 30
"""Characters in the first column of a list at most; less on a narrow terminal."""


class HelpCommand(TyperCommand):
    """Command with a plain help page, --quiet and --verbose."""

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:
        """Parse the arguments, and apply --quiet and --verbose."""
        if all(parameter.name != "quiet" for parameter in self.params):
            self.params = [*self.params, *make_verbosity_options()]
        rest = super().parse_args(ctx, args)
        apply_verbosity(ctx, **{name: ctx.params.pop(name) for name in ("quiet", "verbose")})
        return rest

    def format_help(self, ctx: Any, formatter: Any) -> None:
        """Write the help page."""
        formatter.write(_format_page(self, ctx, formatter.width, {}))


class HelpGroup(TyperGroup):
    """Group of commands with a plain help page."""

    def format_help(self, ctx: Any, formatter: Any) -> None:
        """Write the help page."""
        formatter.write(_format_page(self, ctx, formatter.width, self.groups(ctx)))

    def groups(self, ctx: Any) -> Mapping[str, Mapping[str, str]]:
        """Return the summaries of the commands by heading."""
        commands = {name: self.get_command(ctx, name) for name in self.list_commands(ctx)}
        texts = {name: (command.help or "").partition("\n\n")[0] for name, command in commands.items() if command}
        return {"Commands": texts}


def get_page_width() -> int:
    """Return the width of help pages in characters."""
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
    lines = [*_wrap_words(usage, width, indent="  "), *_format_paragraphs(command.help or "", width)]
    for title, listed in (("Arguments", rows["argument"]), ("Options", rows["option"])):
        if listed:
            lines += ["", f"{title}:", *_format_list(listed, width, _find_longest_name(dict(listed), width))]
    longest = _find_longest_name([name for commands in groups.values() for name in commands], width)
    for title, commands in groups.items():
        lines += ["", f"{title}:", *_format_list(commands.items(), width, longest)]
    return "\n".join(lines) + "\n"


def _format_paragraphs(text: str, width: int) -> Iterator[str]:
    """Wrap paragraphs, but not indented ones."""
    for paragraph in text.split("\n\n"):
        yield ""
        yield from paragraph.splitlines() if paragraph.startswith(" ") else _wrap_words(paragraph, width)


def _find_longest_name(names: Collection[str], width: int) -> int:
    """Return the length of the longest name that fits into the first column."""
    most = min(MAX_NAME_COLUMN_WIDTH, width // 3)
    return max((len(name) for name in names if len(name) <= most), default=most)


def _format_list(rows: Collection[tuple[str, str]], width: int, longest: int) -> Iterator[str]:
    """Format names and texts in two columns. A name too long for its column gets a line of its own."""
    column = 4 + longest
    for name, text in rows:
        texts = _wrap_words(text, width - column) or [""]
        if len(name) <= longest:
            yield f"  {name:{column - 2}}{texts.pop(0)}".rstrip()
        else:
            yield from (f"  {line.replace('| ', '|')}" for line in _wrap_words(name.replace("|", "| "), width - 2))
        yield from (" " * column + line for line in texts)


def _wrap_words(text: str, width: int, indent: str = "") -> list[str]:
    """Wrap text at spaces only, so that option names stay whole. Lines after the first are indented."""
    words = " ".join(text.split())
    return textwrap.wrap(words, width, subsequent_indent=indent, break_long_words=False, break_on_hyphens=False)
