"""Render an HTML page that holds everything it needs, and write it to disk."""

import base64
import hashlib
import re
from functools import cache
from importlib import resources
from pathlib import Path
from typing import Any, NamedTuple

import jinja2
from markupsafe import Markup, escape

from acquisition import DataError, atomic_write
from acquisition.errors import PERMISSION_ERRNOS, join_sentences
from lobewatch.monitoring.drop_text import format_change
from lobewatch.show.terminal.option_names import with_option_names


def render_page(template: str, **content: Any) -> str:
    """Return the HTML of a template in this folder; it gets the style sheet and the script."""
    loader = jinja2.FunctionLoader(_read_text)
    pages = jinja2.Environment(loader=loader, autoescape=True, undefined=jinja2.StrictUndefined, finalize=_name_options)
    pages.filters |= {"in_css": _escape_css, "named": _label_svg, "slug": _make_slug, "unbroken": _join_units}
    pages.filters["class_name"] = lambda part: type(part).__name__
    files = {"style": _read_text("static/report.css"), "script": _read_text("static/report.js")}
    return pages.get_template(template).render(files | content)


@cache
def _read_text(name: str) -> str:
    return resources.files("lobewatch.show.report").joinpath(name).read_text(encoding="utf-8")


def _name_options(value: object) -> object:
    """Name options in what an expression of a template shows, except in finished HTML."""
    return with_option_names(value) if isinstance(value, str) and not isinstance(value, Markup) else value


def script_source() -> str:
    """Return the script of pages as a source of a content security policy."""
    return f"'sha256-{base64.b64encode(hashlib.sha256(_read_text('static/report.js').encode()).digest()).decode()}'"


def write_page(path: Path, html: str) -> None:
    """Write a page, whole or not at all; DataError without write permission."""
    try:
        atomic_write(path, html.encode())
    except OSError as error:
        if error.errno not in PERMISSION_ERRNOS:
            raise
        raise DataError(join_sentences(f"{path}: {error.strerror}", "Name another file with --out")) from error


def _escape_css(text: str) -> str:
    """Escape a name inside a string of a style sheet."""
    return re.sub(r"[^\w .,:;()+-]", lambda match: f"\\{ord(match[0]):x} ", text)


def _make_slug(heading: str) -> str:
    """Return a heading as an identifier and a file name."""
    return re.sub(r"\W+", "-", heading.lower()).strip("-")


def _join_units(text: str) -> str:
    """Prevent line breaks within a number, before its error and before its unit."""
    return re.sub(r"(?<=\d) (?=\d{3}\b|%|±|mm\b|rpm\b|Hz\b)|(?<=±) ", "\N{NO-BREAK SPACE}", text)


def _label_svg(picture: str, name: str) -> Markup:
    return Markup(picture.replace("<svg ", f'<svg role="img" aria-label="{escape(name)}" ', 1))


GAUGE_WIDTH = 120.0
"""Width of the scale (units of the figure)."""


class Gauge(NamedTuple):
    """Lengths of a gauge in units of the figure."""

    text: str
    """Frequency change and its limits."""
    length: float
    """Length of the bar."""
    warn: float
    """Position of the warning limit."""
    alarm: float
    """Position of the alarm limit."""


def make_gauge(drop: float, warn: float, alarm: float, half_width: float | None = None) -> Gauge:
    """Return the gauge of a frequency drop and its limits (%); a rise leaves it empty.

    half_width: half the width of the 95 % interval of the drop (%); None if unknown.
    """
    scale = GAUGE_WIDTH / (1.25 * alarm)
    text = f"f1 change {format_change(drop, half_width)}, warning at -{warn:g} %, alarm at -{alarm:g} %"
    return Gauge(text, min(max(drop, 0.0) * scale, GAUGE_WIDTH), warn * scale, alarm * scale)
