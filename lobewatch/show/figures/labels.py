"""Words beside places in a picture that do not cover one another."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Literal, NamedTuple

from matplotlib.axes import Axes

Side = Literal["right", "left", "above", "below"]
SIDES: dict[Side, tuple[float, float]] = {"right": (1, 0), "left": (-1, 0), "above": (0, 1), "below": (0, -1)}
SIZE = 8.5
"""Size of the letters (points)."""
PHONE = 11.5
"""The same of a small picture on a phone, where letters are larger than the picture is (report.css)."""
HIDDEN = 0.15
"""Share of its area, at most, that words may cover or lie outside before they are left out."""
WIDE, HIGH = 0.62, 1.35
"""A letter and a line, at most, over the size."""
AWAY = 9.0
"""Distance from a place to its words (points)."""
PAPER = {"color": "white", "alpha": 0.75, "pad": 1, "lw": 0}
"""Look of the paper behind words that stand on lines."""


class _Box(NamedTuple):
    """A rectangle in points of the axes."""

    left: float
    low: float
    right: float
    high: float

    @property
    def area(self) -> float:
        """Area (points squared)."""
        return (self.right - self.left) * (self.high - self.low)

    def overlap(self, box: _Box) -> float:
        """Area in common."""
        wide = min(self.right, box.right) - max(self.left, box.left)
        high = min(self.high, box.high) - max(self.low, box.low)
        return wide * high if wide > 0 and high > 0 else 0.0


class PictureLabels:
    """Words in one picture, whose limits are set already."""

    def __init__(self, axes: Axes, room: float = SIZE, *, may_lack: bool = False) -> None:
        """None yet. room: size of letters (points) to leave room for; may_lack: words without room are left out."""
        self._axes = axes
        self._room = room
        self._above = AWAY / 2 * room / SIZE
        self._may_lack = may_lack
        self._taken: list[_Box] = []

    def add(
        self, text: str, place: tuple[float, float], colour: str = "black", sides: Sequence[Side] = tuple(SIDES)
    ) -> None:
        """Put words to that side of a place where they cover least of what is there, the first of several."""
        boxes = {side: self._box(text, place, side) for side in sides}
        best = min(boxes, key=lambda side: self._covered(boxes[side]))
        if self._may_lack and self._covered(boxes[best]) > HIDDEN * boxes[best].area:
            return
        self._taken.append(boxes[best])
        right, up = SIDES[best]
        self._axes.annotate(
            text,
            place,
            xytext=(AWAY * right, self._above * up),
            textcoords="offset points",
            fontsize=SIZE,
            color=colour,
            ha={1: "left", -1: "right"}.get(int(right), "center"),
            va={1: "bottom", -1: "top"}.get(int(up), "center"),
            bbox=PAPER,
        )

    def keep_free(self, low: tuple[float, float], high: tuple[float, float]) -> None:
        """No words between two corners, where there is a choice."""
        self._taken.append(_Box(*self._points(low), *self._points(high)))

    def keep_clear(self, place: tuple[float, float], size: float) -> None:
        """No words over a mark of this size (points), where there is a choice."""
        x, y = self._points(place)
        self._taken.append(_Box(x - size / 2, y - size / 2, x + size / 2, y + size / 2))

    def _box(self, text: str, place: tuple[float, float], side: Side) -> _Box:
        lines, (right, up) = text.split("\n"), SIDES[side]
        wide, high = WIDE * self._room * max(map(len, lines)), HIGH * self._room * len(lines)
        x, y = self._points(place)
        middle = x + right * (AWAY + wide / 2), y + up * (self._above + high / 2)
        return _Box(middle[0] - wide / 2, middle[1] - high / 2, middle[0] + wide / 2, middle[1] + high / 2)

    def _covered(self, box: _Box) -> float:
        """Area of other words, and area outside of the axes."""
        inside = box.overlap(_Box(0, 0, *self._size))
        return box.area - inside + sum(box.overlap(taken) for taken in self._taken)

    def _points(self, place: tuple[float, float]) -> tuple[float, float]:
        shares = (
            (value - low) / (high - low)
            for value, (low, high) in zip(place, (self._axes.get_xlim(), self._axes.get_ylim()), strict=True)
        )
        x, y = (share * size for share, size in zip(shares, self._size, strict=True))
        return x, y

    @property
    def _size(self) -> tuple[float, float]:
        box = self._axes.get_window_extent()
        points = 72 / self._axes.figure.dpi
        return box.width * points, box.height * points
