"""Command `lobewatch paper`: compare with the paper of Gaber & Hashemi."""

from pathlib import Path
from typing import Annotated

from typer import Option

from lobewatch.show.terminal.output import Json, emit


def paper(
    out: Annotated[Path | None, Option(help="Folder for a page (paper.md) with figures.")] = None,
    as_json: Json = False,
) -> None:
    """Compare lobewatch with Gaber & Hashemi.

    All figures are computed on a surrogate of their spindle. The comparison gives a reason for each difference.

    Examples
    --------
      lobewatch paper
      lobewatch paper --out paper
    """
    from lobewatch.commands.help_page import get_page_width
    from lobewatch.paper import study_paper
    from lobewatch.show.paper.paper_text import paper_json, paper_lines

    study = study_paper()
    page = None
    if out is not None:
        from lobewatch.show.paper.paper_page import write_paper_page

        page = write_paper_page(study, out)
    written = [f"page: {page}"] if page else []
    emit(paper_json(study, page), as_json, *paper_lines(study, get_page_width()), *written)
