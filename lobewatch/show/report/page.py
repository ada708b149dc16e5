"""A page with everything in it, and its place on the disk."""

from __future__ import annotations

import base64
import hashlib
import re
from functools import cache
from importlib import resources
from pathlib import Path
from typing import Any

import jinja2
from markupsafe import Markup, escape

from acquisition import DataError, atomic_write
from acquisition.errors import NOT_ALLOWED

NOTICE = "/* uPlot 1.6.32, (c) 2022 Leon Sorokin, MIT licence */"
"""First line of the script of the plots in place of its own, which has an address: a page names none."""


def page(template: str, **content: Any) -> str:
    """HTML of a template beside `report.html`; it is handed styles, script and plots."""
    room = resources.files("lobewatch.show.report")
    loader = jinja2.FunctionLoader(lambda name: room.joinpath(name).read_text(encoding="utf-8"))
    environment = jinja2.Environment(loader=loader, autoescape=True, undefined=jinja2.StrictUndefined)
    environment.filters |= {
        "in_css": _in_css,
        "named": _named,
        "macro_name": _macro_name,
        "next": next,
        "unbroken": _unbroken,
    }
    return environment.get_template(template).render(_static() | content)


def script_sources() -> str:
    """The scripts of pages as sources of a content security policy."""
    digests = (hashlib.sha256(_static()[name].encode()).digest() for name in ("script", "plot_script"))
    return " ".join(f"'sha256-{base64.b64encode(digest).decode()}'" for digest in digests)


def write_page(path: Path, html: str) -> None:
    """Write a page, whole or not at all; DataError where that is not allowed."""
    try:
        atomic_write(path, html.encode())
    except OSError as error:
        if error.errno not in NOT_ALLOWED:
            raise
        raise DataError(f"{path}: {error.strerror}; name another file with --out") from error


@cache
def _static() -> dict[str, str]:
    pages, plots = (resources.files(f"lobewatch.{room}").joinpath("static") for room in ("show.report", "screen"))
    plot_script = plots.joinpath("uPlot.iife.min.js").read_text(encoding="utf-8")
    return {
        "style": pages.joinpath("report.css").read_text(encoding="utf-8"),
        "script": pages.joinpath("report.js").read_text(encoding="utf-8"),
        "plot_style": plots.joinpath("uPlot.min.css").read_text(encoding="utf-8"),
        "plot_script": NOTICE + plot_script.partition("*/")[2],
    }


def _in_css(text: str) -> str:
    """A name as part of a string of a style sheet."""
    return re.sub(r"[^\w .,:;()+-]", lambda match: f"\\{ord(match[0]):x} ", text)


def _macro_name(part: object) -> str:
    """The macro of parts.html that shows a part of a section: the name of its class in small letters."""
    return type(part).__name__.lower()


def _unbroken(text: str) -> str:
    """No line ends within a number, between it and its error, or before its unit."""
    return re.sub(r"(?<=\d) (?=\d{3}\b|%|±|mm\b|rpm\b|Hz\b)|(?<=±) ", "\N{NO-BREAK SPACE}", text)


def _named(picture: str, name: str) -> Markup:
    return Markup(picture.replace("<svg ", f'<svg role="img" aria-label="{escape(name)}" ', 1))
