"""The pages: none is missing in the index, every link lives, every test that is named is there."""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
DOCS = ROOT / "docs"
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


@pytest.mark.parametrize("folder", [DOCS, DOCS / "decisions", DOCS / "studies"], ids=lambda folder: folder.name)
def test_an_index_has_every_page_once_and_a_line_for_each(folder: Path) -> None:
    index = folder / "README.md"
    linked = [path for path, _ in links(index) if folder in path.parents]
    pages = [page for page in folder.rglob("*.md") if page != index]
    others = [page for page in pages if page.parent.name in ("decisions", "studies") and folder == DOCS]
    assert sorted(linked) == sorted({*pages}.difference(others) | {page for page in others if page.name == "README.md"})
    items = re.findall(r"^\* .*$", index.read_text(encoding="utf-8"), re.MULTILINE)
    assert all(len(re.findall(r"\]\(", item)) == 1 for item in items)
    assert len(items) == len(list(links(index))) - (folder == DOCS)  # the sentence on top has a link


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
