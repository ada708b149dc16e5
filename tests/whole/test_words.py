"""Plain words: short sentences and no phrase of docs/words.txt on user pages and in texts of the program."""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator
from dataclasses import dataclass
from html.parser import HTMLParser
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
PACKAGES = ("acquisition", "modal", "dsm", "lobes", "lobewatch", "sim_data")
CONTRIBUTOR_PAGES = ("CONTRIBUTING.md", "architecture.md")
STUDIES = ("decisions", "studies", "api")
MIN_WORDS = 3
"""Fewest words of a string that is read as a text; shorter ones are keys, units and labels."""
WORD = re.compile(r"[A-Za-z0-9][\w'.,%/+-]*")
CODE = re.compile(
    r"`[^`]*`|https?://\S+|(?<![\w`])--?[a-z][\w-]*|\b\w+(?:[._/]\w+)*_\w+(?:\.\w+)*\b|\b[\w/]+\.(?:toml|csv|h5|md|py|html|jsonl?|rows)\b"
)
"""Code, addresses, options, keys with an underscore and names of files."""
PHRASES = [
    line.strip() for line in (ROOT / "docs" / "words.txt").read_text("utf-8").splitlines() if line and line[0] != "#"
]
PHRASE = re.compile(rf"\b(?:{'|'.join(map(re.escape, PHRASES))})\b", re.IGNORECASE)


@dataclass(frozen=True)
class Sentence:
    """One sentence that a person reads."""

    place: str
    """File and line."""
    text: str
    """The sentence; code and fields of f-strings are the word CODE."""

    @property
    def words(self) -> int:
        """Number of words."""
        return len(WORD.findall(self.text))


def split_sentences(place: str, text: str) -> Iterator[Sentence]:
    """Yield the sentences of a text; a full stop, question or exclamation mark or an empty line ends one."""
    for part in re.split(r"(?<=[.!?])[\"')*_]*\s+|\n\s*\n", CODE.sub("CODE", text)):
        if len(WORD.findall(part)) >= MIN_WORDS:
            yield Sentence(place, " ".join(part.split()))


def page_sentences(page: Path) -> Iterator[Sentence]:
    """Yield the sentences of a Markdown page; a table cell, list item or heading ends one."""
    text = re.sub(r"^ *(```|~~~).*?^ *\1", "", page.read_text("utf-8"), flags=re.MULTILINE | re.DOTALL)
    text = re.sub(r"(?<=\n\n)(?: {4}.*\n)+", "", text)
    text = re.sub(r"<!--.*?-->", "", text, flags=re.DOTALL)
    text = re.sub(r"^\$\$.*?\$\$|\$[^$\n]+\$", "CODE", text, flags=re.MULTILINE | re.DOTALL)
    text = re.sub(r"!?\[([^\]]*)\]\([^)]*\)", r"\1", text)
    for block in re.split(r"\n\s*\n|\n(?=\s*(?:[-*|#>]|\d+\.)\s*)|\n(?<=\S)(?=#)", text):
        for cell in block.split("|") if block.lstrip().startswith("|") else [block]:
            yield from split_sentences(str(page.relative_to(ROOT)), cell.strip(" #>*-\n"))


def find_silent(tree: ast.AST, shown: str) -> set[int]:
    """Return the parts of f-strings, which are read as a whole, and the docstrings but that of the function `shown`."""
    silent = set[int]()
    for node in ast.walk(tree):
        if isinstance(node, ast.JoinedStr):
            silent |= {id(value) for value in ast.walk(node) if value is not node}
        body = getattr(node, "body", None)
        if isinstance(body, list) and getattr(node, "name", "") != shown:
            silent |= {id(entry.value) for entry in body if isinstance(entry, ast.Expr)}
    return silent


def string_sentences(file: Path) -> Iterator[Sentence]:
    """Yield the sentences of the strings of a module that are texts, and of the docstring of a command."""
    tree = ast.parse(file.read_text("utf-8"))
    silent = find_silent(tree, file.stem if file.parent.name == "commands" else "-")
    for node in ast.walk(tree):
        values = node.values if isinstance(node, ast.JoinedStr) else [node]
        if id(node) in silent or not (isinstance(node, ast.JoinedStr) or isinstance(getattr(node, "value", 0), str)):
            continue
        text = "".join(str(value.value) if isinstance(value, ast.Constant) else "CODE" for value in values)
        text = text.partition("\nExamples\n---")[0]
        if " " in text.strip() and len(re.findall(r"[A-Za-z]{2,}", text)) >= MIN_WORDS:
            yield from split_sentences(f"{file.relative_to(ROOT)}:{getattr(node, 'lineno', 0)}", text)


BLOCKS = {
    "p",
    "div",
    "li",
    "td",
    "th",
    "tr",
    "h1",
    "h2",
    "h3",
    "h4",
    "button",
    "label",
    "option",
    "summary",
    "dt",
    "dd",
}
BLOCKS |= {"figcaption", "title", "section"}
"""Tags that end a sentence."""
SHOWN_ATTRIBUTES = ("aria-label", "title", "alt", "placeholder")


class _Texts(HTMLParser):
    """Texts of a page and of the attributes that are shown or read out."""

    def __init__(self) -> None:
        super().__init__()
        self.texts, self.silent = [""], 0

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        """Begin a block, and keep texts of attributes."""
        self.silent += tag in ("script", "style")
        shown = [value or "" for name, value in attrs if name in SHOWN_ATTRIBUTES]
        if tag in BLOCKS or shown:
            self.texts += [*shown, ""]

    def handle_endtag(self, tag: str) -> None:
        """End a block."""
        self.silent -= tag in ("script", "style")
        if tag in BLOCKS:
            self.texts.append("")

    def handle_data(self, data: str) -> None:
        """Keep a text."""
        if not self.silent:
            self.texts[-1] += data


def template_sentences(file: Path) -> Iterator[Sentence]:
    """Yield the sentences of an HTML page or template, Jinja expressions as the word CODE."""
    text = re.sub(r"\{#.*?#\}|\{%.*?%\}", "", file.read_text("utf-8"), flags=re.DOTALL)
    parser = _Texts()
    parser.feed(re.sub(r"\{\{.*?\}\}", "CODE", text, flags=re.DOTALL))
    for part in parser.texts:
        yield from split_sentences(str(file.relative_to(ROOT)), part)


def script_sentences(file: Path) -> Iterator[Sentence]:
    """Yield the sentences of the strings of a script of a page."""
    text = re.sub(r"^\s*//.*$|/\*.*?\*/", "", file.read_text("utf-8"), flags=re.MULTILINE | re.DOTALL)
    for match in re.finditer(r'"((?:[^"\\\n]|\\.)*)"|`((?:[^`\\]|\\.)*)`', text):
        string = re.sub(r"\$\{[^}]*\}", "CODE", match[1] or match[2] or "")
        if " " in string.strip() and len(re.findall(r"[A-Za-z]{2,}", string)) >= MIN_WORDS and "<" not in string:
            yield from split_sentences(f"{file.relative_to(ROOT)}:{text.count(chr(10), 0, match.start()) + 1}", string)


def user_pages() -> list[Path]:
    """Return README and the pages for users and contributors, without studies and decisions."""
    pages = [page for page in (ROOT / "docs").rglob("*.md") if page.relative_to(ROOT / "docs").parts[0] not in STUDIES]
    return [ROOT / "README.md", ROOT / "CONTRIBUTING.md", *sorted(pages)]


def count_words(page: Path) -> int:
    """Return the number of words of a page, with code and tables."""
    return sum(any(letter.isalnum() for letter in word) for word in page.read_text("utf-8").split())


def sentences_of(kind: str) -> list[Sentence]:
    """Return all sentences of the user pages, or of the program."""
    if kind == "pages":
        return [sentence for page in user_pages() for sentence in page_sentences(page)]
    kinds = {"*.py": string_sentences, "*.html": template_sentences, "*.js": script_sentences, "*.md": page_sentences}
    files = [
        (file, read) for package in PACKAGES for end, read in kinds.items() for file in (ROOT / package).rglob(end)
    ]
    return [sentence for file, read in sorted(files) if not file.name.endswith(".min.js") for sentence in read(file)]


@pytest.mark.parametrize("kind", ["pages", "program"])
def test_sentences_are_short_and_plain(kind: str) -> None:
    sentences = sentences_of(kind)
    words = sum(sentence.words for sentence in sentences)
    assert len(sentences) > 1500
    assert words / len(sentences) <= 16
    assert sum(sentence.words > 30 for sentence in sentences) <= 0.04 * len(sentences)
    assert sum(sentence.text.count(";") for sentence in sentences) <= 0.03 * len(sentences)
    vague = [word for each in sentences for word in re.findall(r"\b(?:what|where|whoever)\b", each.text, re.IGNORECASE)]
    assert len(vague) <= 0.004 * words
    assert [f"{each.place}: {each.text}" for each in sentences if PHRASE.search(each.text)] == []


def test_user_pages_are_few_words() -> None:
    assert sum(count_words(page) for page in user_pages() if page.name not in CONTRIBUTOR_PAGES) <= 45_000
    for name in ("cuts", "modal", "decay", "lobes"):
        assert count_words(ROOT / "docs" / f"{name}.md") <= 1800


@pytest.mark.parametrize(
    ("text", "words"),
    [("Use `a b c` now. Stop the spindle first!", [3, 4]), ("A drop of 2.5 % is\n\nseen in x", [5, 3])],
)
def test_a_sentence_ends_at_a_stop_and_code_is_one_word(text: str, words: list[int]) -> None:
    assert [sentence.words for sentence in split_sentences("", text)] == words
