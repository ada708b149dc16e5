"""Animated figure of mode shapes: a self-contained SVG or HTML file that moves in every browser."""

from collections.abc import Iterator, Sequence
from html import escape
from pathlib import Path

import numpy as np

from acquisition import atomic_write
from lobewatch.arrays import Floats
from lobewatch.measurement.folder_shapes import FolderShapes, MeasuredPoint
from lobewatch.measurement.point_table import PARTS
from lobewatch.show.figures.drawing import Paint
from lobewatch.show.terminal.output import make_printable
from modal import ModeShape, PartShare

MAX_DRAWN_MODES = 6
"""Most modes of one figure: those with the highest peaks at the tip; chosen."""
FRAMES = 24
"""Pictures of one period; the browser moves evenly between them; chosen."""
PERIOD = 2
"""Period of the animation (s); chosen."""
PART_PAINTS = dict(zip(PARTS, (Paint.NEWEST, Paint.GOOD, Paint.ALARM, Paint.FIRST), strict=True))
"""Paint of the points and shares of each part."""
WIDTH, LEFT, RIGHT = 900, 24, 600
"""Width of the figure, and ends of the axis in it (px)."""
HEADER, PANEL, SWING = 64, 150, 46
"""Height of the header and of the panel of a mode, and largest motion in it (px)."""
BAR_LEFT, BAR_WIDTH, BAR_LABEL = 620, 260, 150
"""Place and width of the shares with their labels, and width of the labels (px)."""


def save_shape_animation(found: FolderShapes, path: Path) -> None:
    """Write the animation as .svg or .html. ValueError for another ending, and without a mode."""
    if path.suffix.lower() not in (".svg", ".html"):
        raise ValueError(f"{path}: unsupported file type {path.suffix!r}. Use .svg or .html.")
    if not found.accepted:
        raise ValueError(f"{found.folder}: no mode to draw. Check the frequency band.")
    svg = draw_shape_animation(found)
    title = f"<title>{_text(f'Mode shapes of {found.folder.name}')}</title>"
    page = f'<!doctype html>\n<html lang="en"><head><meta charset="utf-8">{title}</head><body>\n{svg}</body></html>\n'
    atomic_write(path, (svg if path.suffix.lower() == ".svg" else page).encode())


def draw_shape_animation(found: FolderShapes) -> str:
    """Return an <svg> element with a moving panel for each mode, next to its shares."""
    strongest = sorted(found.accepted, key=lambda i: -found.shapes[i].mode.peak)[:MAX_DRAWN_MODES]
    drawn = sorted(strongest, key=lambda i: found.shapes[i].mode.frequency)
    height = HEADER + PANEL * len(drawn) + 24
    name = _text(f"Mode shapes of {found.folder.name}")
    style = "font-family:sans-serif;font-size:12px;background:white"
    box = f'width="{WIDTH}" height="{height}" viewBox="0 0 {WIDTH} {height}"'
    lines = [f'<svg xmlns="http://www.w3.org/2000/svg" role="img" aria-label="{name}" {box} style="{style}">']
    lines += [f"<title>{name}</title>", *_draw_header(found.points, name)]
    for row, i in enumerate(drawn):
        lines += _draw_mode(found.points, found.shapes[i], found.shares[i], HEADER + PANEL * row)
    foot = f"{len(drawn)} of {len(found.accepted)} modes, those with the highest peaks. Dashed: largest motion."
    lines.append(f'<text x="{LEFT}" y="{height - 8}" fill="#555">{foot}</text>')
    return "\n".join([*lines, "</svg>\n"])


def _draw_header(points: Sequence[MeasuredPoint], name: str) -> Iterator[str]:
    """Yield the title, and the name and place of each point."""
    yield f'<text x="{LEFT}" y="18" font-weight="bold" font-size="14">{name}</text>'
    yield f'<text x="{BAR_LEFT}" y="18" font-weight="bold">share of 1/K at the tip</text>'
    end = -np.inf
    for point, x in zip(points, _place(points), strict=True):
        label = _text(point.name)
        if x - end >= 7 * len(label) + 6:  # room for its letters
            yield f'<text x="{x:.1f}" y="40" text-anchor="middle" fill="{PART_PAINTS[point.part]}">{label}</text>'
            end = x
    first, last = (f"{points[i].position * 1e3:.4g} mm" for i in (0, -1))
    yield f'<text x="{LEFT}" y="56" fill="#555">{first}</text>'
    yield f'<text x="{RIGHT}" y="56" fill="#555" text-anchor="end">{last} from the tip</text>'


def _draw_mode(
    points: Sequence[MeasuredPoint], shape: ModeShape, shares: Sequence[PartShare], top: float
) -> Iterator[str]:
    mode, middle = shape.mode, top + PANEL / 2 + 10
    figures = f"{mode.frequency:.1f} Hz, zeta {100 * mode.damping_ratio:.2f} %, K {mode.stiffness / 1e6:.3g} N/um"
    yield f'<text x="{LEFT}" y="{top + 16}">{figures}, MPC {shape.phase_collinearity:.2f}</text>'
    yield f'<line x1="{LEFT}" x2="{RIGHT}" y1="{middle}" y2="{middle}" stroke="#bbb"/>'
    phases = 2 * np.pi * np.arange(FRAMES + 1) / FRAMES
    motion = np.real(shape.motion * np.exp(1j * phases[:, np.newaxis])) / np.max(np.abs(shape.motion))
    x, y = _place(points), middle - SWING * motion
    for is_column, colour in ((True, PART_PAINTS[PARTS[-1]]), (False, "#222")):
        own = [i for i, point in enumerate(points) if (point.part == PARTS[-1]) == is_column]
        frames = [" ".join(f"{x[i]:.1f},{frame[i]:.1f}" for i in own) for frame in y]
        line = f'points="{frames[0]}" fill="none" stroke="{colour}"'
        if len(own) > 1:
            yield f'<polyline {line} stroke-dasharray="3 3" opacity="0.6"/>'
            yield f'<polyline {line} stroke-width="2">{_animate("points", frames)}</polyline>'
    for i, point in enumerate(points):
        moves = _animate("cy", [f"{frame[i]:.1f}" for frame in y])
        dot = f'<circle cx="{x[i]:.1f}" cy="{y[0, i]:.1f}" r="5" fill="{PART_PAINTS[point.part]}">'
        yield f"{dot}<title>{_text(point.name)}: {shape.motion[i].real:+.3f}</title>{moves}</circle>"
    yield from _draw_shares(shares, top + 34)


def _draw_shares(shares: Sequence[PartShare], top: float) -> Iterator[str]:
    """Yield a bar for each share, to the left of the zero line if it is negative."""
    low, high = min(0.0, *(row.share for row in shares)), max(1.0, *(row.share for row in shares))
    scale = (BAR_WIDTH - BAR_LABEL) / (high - low)
    zero = BAR_LEFT + BAR_LABEL - low * scale
    for number, row in enumerate(shares):
        y, end = top + 24 * number, zero + row.share * scale
        label = f"{' + '.join(row.parts)} {round(100 * row.share)} %"
        yield f'<text x="{BAR_LEFT + BAR_LABEL - 6}" y="{y + 12}" text-anchor="end">{label}</text>'
        place = f'x="{min(zero, end):.1f}" y="{y}" width="{abs(end - zero):.1f}" height="16"'
        yield f'<rect {place} fill="{PART_PAINTS[row.parts[0]]}"/>'
    yield f'<line x1="{zero:.1f}" x2="{zero:.1f}" y1="{top - 4}" y2="{top + 24 * len(shares)}" stroke="#222"/>'


def _place(points: Sequence[MeasuredPoint]) -> Floats:
    """Return the horizontal place of each point (px)."""
    position = np.array([point.position for point in points])
    return np.asarray(LEFT + (RIGHT - LEFT) * (position - position[0]) / (position[-1] - position[0]))


def _animate(attribute: str, frames: Sequence[str]) -> str:
    values = ";".join(frames)
    return f'<animate attributeName="{attribute}" dur="{PERIOD}s" repeatCount="indefinite" values="{values}"/>'


def _text(text: str) -> str:
    return escape(make_printable(text, ""))
