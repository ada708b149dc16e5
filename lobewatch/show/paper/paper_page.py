"""A page of the comparison with the paper, with its figures beside it."""

from __future__ import annotations

from importlib import resources
from pathlib import Path

import jinja2

from acquisition import DataError
from acquisition.atomic import atomic_write, make_folder
from lobewatch.paper import PaperStudy
from lobewatch.show.figures.style import save_figure
from lobewatch.show.paper.describe_paper import cells
from lobewatch.show.paper.paper_figures import FIGURES

PAGE = "paper.md"
"""Name of the page, and of its template."""


def paper_page(study: PaperStudy) -> str:
    """The page in Markdown."""
    template = resources.files("lobewatch.show.paper").joinpath(PAGE).read_text(encoding="utf-8")
    environment = jinja2.Environment(undefined=jinja2.StrictUndefined, trim_blocks=True, keep_trailing_newline=True)
    return environment.from_string(template).render(study=study, cells=cells, figures=FIGURES)


def write_paper(study: PaperStudy, folder: Path) -> Path:
    """Write the page, and its figures in `images`, into a folder, made where it is not there; DataError for a file."""
    if folder.exists() and not folder.is_dir():
        raise DataError(f"{folder}: is a file; name a folder with --out")
    make_folder(folder / "images")
    for name, picture in FIGURES.items():
        save_figure(picture.draw(study), folder / "images" / f"paper-{name}.png")
    page = folder / PAGE
    atomic_write(page, paper_page(study).encode())
    return page
