"""Build the documentation site from README, docs/ and the docstrings: `.venv/bin/python docs/make_site.py [FOLDER]`.

The site needs no network: open index.html of the folder (build/docs), its search works there too.
"""

from __future__ import annotations

import inspect
import os
import re
import shutil
import sys
import tempfile
import webbrowser
from collections.abc import Iterator
from importlib import import_module
from pathlib import Path

from sphinx.cmd.build import build_main
from sphinx.pycode import ModuleAnalyzer

ROOT = Path(__file__).parents[1]
DOCS = ROOT / "docs"
ROOMS = ("fleet", "history", "logbook", "machine", "measurement", "monitoring", "tool", "verdicts")
MODULES = ("acquisition", "modal", "dsm", "lobes", "lobewatch", *(f"lobewatch.{room}" for room in ROOMS))
"""Modules with an API page."""
TABLE = "\n```{{toctree}}\n:hidden:\n:caption: {}\n\n{}\n```\n"
LINK = re.compile(r"(?<!!)\[((?:[^][]|\[[^]]*\])+)\]\(([^)#\s]*)(#[^)\s]*)?\)")


def collect_pages() -> Iterator[Path]:
    """Yield the Markdown pages of the site."""
    yield from (ROOT / name for name in ("README.md", "CHANGELOG.md", "CONTRIBUTING.md"))
    yield from DOCS.rglob("*.md")


def write_sources(folder: Path) -> None:
    """Copy pages and pictures, and write the API pages.

    A link to a file that is no page, such as a program in examples/, becomes its text.
    """
    pages = set(collect_pages())
    for page in pages:
        text = page.read_text("utf-8")

        def keep_link(match: re.Match[str], home: Path = page.parent) -> str:
            target = (home / match[2]).resolve()
            return match[0] if not match[2] or "://" in match[2] or target in pages else match[1]

        target = folder / page.relative_to(ROOT)
        target.parent.mkdir(parents=True, exist_ok=True)
        target.write_text(LINK.sub(keep_link, text) + list_pages(page), encoding="utf-8")
    shutil.copytree(DOCS / "images", folder / "docs" / "images")
    (folder / "docs" / "api").mkdir()
    for module in MODULES:
        lines = [module, "=" * len(module), "", f".. automodule:: {module}", "   :members:", "   :imported-members:"]
        lines += ["   :no-index:"] * (module == "lobewatch")  # its names are those of its rooms
        lines += describe_constants(module) if module != "lobewatch" else []
        (folder / "docs" / "api" / f"{module}.rst").write_text("\n".join(lines) + "\n", encoding="utf-8")


def describe_constants(module: str) -> Iterator[str]:
    """Yield the entries of the constants and types of a package, documented in the modules below it."""
    below = [name for name in sorted(sys.modules) if name.startswith(f"{module}.")]
    for constant in import_module(module).__all__:
        value = getattr(import_module(module), constant)
        if inspect.isclass(value) or inspect.isroutine(value):
            continue
        homes = (name for name in below if vars(sys.modules[name]).get(constant) is value)
        texts = (ModuleAnalyzer.for_module(name).find_attr_docs().get(("", constant)) for name in homes)
        yield from ("", f".. py:data:: {constant}", "")
        yield from (f"   {line}" for line in next(filter(None, texts), []))


def list_pages(page: Path) -> str:
    """Return the tables of contents of the side bar, a table for each heading of the index of a folder."""
    index = DOCS / "README.md" if page == ROOT / "README.md" else page
    if index.name != "README.md" or page == DOCS / "README.md":
        return ""
    contents = {"All pages": ["docs/README"]} if index != page else {}
    for section in re.split(r"^#+ ", index.read_text("utf-8"), flags=re.MULTILINE)[1:]:
        links = [os.path.relpath(index.parent / match[2], page.parent) for match in LINK.finditer(section)]
        contents[section.splitlines()[0]] = [
            link for link in links if link.endswith(".md") and (page.parent / link).resolve() != page
        ]
    if index != page:
        contents["Python"] = [f"docs/api/{module}" for module in MODULES]
    return "".join(TABLE.format(heading, "\n".join(links)) for heading, links in contents.items() if links)


def build(folder: Path) -> int:
    """Build the site and return Sphinx's exit code: a warning, such as a broken link, is an error."""
    for module in map(import_module, MODULES):
        for name in module.__all__:
            setattr(module, name, getattr(module, name))
    with tempfile.TemporaryDirectory() as work:
        write_sources(Path(work))
        arguments = ["-W", "--keep-going", "-q", "-c", str(DOCS), "-d", f"{work}/.doctrees", work, str(folder)]
        code = build_main(arguments)
    (folder / "index.html").write_text('<meta http-equiv="refresh" content="0; url=README.html">', encoding="utf-8")
    return code


if __name__ == "__main__":
    site = Path(sys.argv[1]) if sys.argv[1:] else ROOT / "build" / "docs"
    address = (site / "index.html").absolute().as_uri()
    status = build(site)
    sys.stdout.write(f"documentation: {address}\n")
    if not sys.argv[1:] and (sys.platform in ("win32", "darwin") or os.environ.keys() & {"DISPLAY", "WAYLAND_DISPLAY"}):
        webbrowser.open(address)
    sys.exit(status)
