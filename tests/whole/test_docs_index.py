"""The pages: none is missing in the index, every link lives, every test that is named is there."""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
DOCS = ROOT / "docs"
INDEX = DOCS / "README.md"
PAGES = sorted([ROOT / "README.md", ROOT / "CONTRIBUTING.md", ROOT / "CHANGELOG.md", *DOCS.rglob("*.md")])


def links(page: Path) -> Iterator[tuple[Path, str]]:
    """File and heading of every link that stays in the checkout."""
    for link in re.findall(r"\]\(([^)\s]+)\)", page.read_text(encoding="utf-8")):
        if not link.startswith("https://"):
            path, _, heading = link.partition("#")
            yield (page.parent / path).resolve() if path else page, heading


def headings(page: Path) -> set[str]:
    """Headings as links name them."""
    found = re.findall(r"^#+ (.+)$", page.read_text(encoding="utf-8"), re.MULTILINE)
    return {re.sub(r"[^\w\- ]", "", heading.lower()).replace(" ", "-") for heading in found}


def test_the_index_has_every_page_once_and_a_line_for_each() -> None:
    linked = [path for path, _ in links(INDEX) if DOCS in path.parents]
    pages = [page for page in DOCS.rglob("*.md") if page != INDEX]
    assert sorted(linked) == sorted([*pages, DOCS / "api" / "index.html"])
    items = re.findall(r"^\* .*$", INDEX.read_text(encoding="utf-8"), re.MULTILINE)
    assert all(len(re.findall(r"\]\(", item)) == 1 for item in items)
    assert len(items) == len(list(links(INDEX))) - 1  # the first link is that of the sentence on top


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.relative_to(ROOT).as_posix())
def test_every_link_lives(page: Path) -> None:
    for path, heading in links(page):
        assert path.exists(), path
        assert ROOT in path.parents, path
        assert not heading or heading in headings(path), (path, heading)


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.relative_to(ROOT).as_posix())
def test_every_file_and_test_that_is_named_is_there(page: Path) -> None:
    text = page.read_text(encoding="utf-8")
    for name, function in re.findall(r"`((?:tests/)?[\w/]*test_\w+\.py)(?:::(\w+))?", text):
        path = ROOT / name
        assert path.exists(), name
        assert f"def {function}(" in path.read_text(encoding="utf-8") or not function, (name, function)
