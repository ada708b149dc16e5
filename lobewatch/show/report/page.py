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
from acquisition.errors import PERMISSION_ERRNOS
from lobewatch.show.terminal.option_names import with_option_names

UPLOT_NOTICE = "/* uPlot 1.6.32, (c) 2022 Leon Sorokin, MIT licence */"
"""First line of the plot script, instead of its own, which has an address: a page contains none."""


def render_page(template: str, **content: Any) -> str:
    """Return the HTML of a template in this folder; it gets styles, scripts and plots."""
    room = resources.files("lobewatch.show.report")
    loader = jinja2.FunctionLoader(lambda name: room.joinpath(name).read_text(encoding="utf-8"))
    pages = jinja2.Environment(loader=loader, autoescape=True, undefined=jinja2.StrictUndefined, finalize=_name_options)
    pages.filters |= {"in_css": _escape_css, "named": _label_svg, "next": next, "unbroken": _join_units}
    pages.filters["macro_name"] = lambda part: type(part).__name__.lower()
    return pages.get_template(template).render(_static_files() | content)


def _name_options(value: object) -> object:
    """Name options in what an expression of a template shows, except in finished HTML."""
    return with_option_names(value) if isinstance(value, str) and not isinstance(value, Markup) else value


def script_sources() -> str:
    """Return the scripts of pages as sources of a content security policy."""
    digests = (hashlib.sha256(_static_files()[name].encode()).digest() for name in ("script", "plot_script"))
    return " ".join(f"'sha256-{base64.b64encode(digest).decode()}'" for digest in digests)


def write_page(path: Path, html: str) -> None:
    """Write a page, whole or not at all; DataError where that is not allowed."""
    try:
        atomic_write(path, html.encode())
    except OSError as error:
        if error.errno not in PERMISSION_ERRNOS:
            raise
        raise DataError(f"{path}: {error.strerror}; name another file with --out") from error


@cache
def _static_files() -> dict[str, str]:
    pages, plots = (resources.files(f"lobewatch.{room}").joinpath("static") for room in ("show.report", "screen"))
    plot_script = plots.joinpath("uPlot.iife.min.js").read_text(encoding="utf-8")
    return {
        "style": pages.joinpath("report.css").read_text(encoding="utf-8"),
        "script": pages.joinpath("report.js").read_text(encoding="utf-8"),
        "plot_style": plots.joinpath("uPlot.min.css").read_text(encoding="utf-8"),
        "plot_script": UPLOT_NOTICE + plot_script.partition("*/")[2],
    }


def _escape_css(text: str) -> str:
    """Escape a name inside a string of a style sheet."""
    return re.sub(r"[^\w .,:;()+-]", lambda match: f"\\{ord(match[0]):x} ", text)


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
    """Frequency change in words, with its limits."""
    length: float
    """Length of the bar."""
    warn: float
    """Place of the warning limit."""
    alarm: float
    """Place of the alarm limit."""


def make_gauge(fall: float, warn: float, alarm: float) -> Gauge:
    """Return the gauge of a frequency drop and its limits (%); a rise leaves it empty."""
    scale = GAUGE_WIDTH / (1.25 * alarm)
    text = f"frequency {-fall:+z.2f} %; warning at -{warn:g} %, alarm at -{alarm:g} %"
    return Gauge(text, min(max(fall, 0.0) * scale, GAUGE_WIDTH), warn * scale, alarm * scale)
