"""Test bands, boxes, marks and labels of lobe figures."""

from __future__ import annotations

from itertools import combinations

import numpy as np
import pytest
from matplotlib.patches import Rectangle

from lobewatch.machine import ProgramTable
from lobewatch.show.figures.drawing import LabelPlacer, new_axes
from lobewatch.show.figures.lobe_figures import plot_lobes
from lobewatch.verdicts import Setting, Stability, Verdict
from lobewatch.verdicts.monte_carlo import LimitBand
from tests.lobewatch.show.figures.lobe_diagrams import diagram_of

pytestmark = pytest.mark.quick


def test_band_boxes_and_marks_stand_where_the_numbers_say() -> None:
    speed, depth = np.linspace(1000.0, 2000.0, 5), np.full(5, 2e-3)
    cut = {"teeth": 2, "radial_depth_mm": 5, "tool_diameter_mm": 10, "direction": "up", "material": "any"}
    marks = [
        Verdict(ProgramTable(name=f"p{i}", speed_rpm=1100.0 + 250 * i, depth_mm=3.0, **cut), word)  # type: ignore[arg-type]
        for i, word in enumerate(Stability)
    ]
    band, pocket = LimitBand(speed, 0.5 * depth, 2 * depth), Setting(1500.0, 0.85, (1400.0, 1650.0), 0.3, 0.02)
    diagram = diagram_of(speed, {"then": 0.9 * depth, "now": depth}, verdicts=marks, band=band, pockets=[pocket])
    (axes,) = plot_lobes(diagram).axes
    shade, filled = (np.asarray(one.get_paths()[0].vertices)[:, 1] for one in axes.collections)
    assert (filled.min(), filled.max()) == pytest.approx((1.0, 4.0))
    assert shade.min() == pytest.approx(4.0)
    (box,) = axes.patches
    assert isinstance(box, Rectangle)
    assert (box.get_x(), box.get_width(), box.get_y(), box.get_height()) == (1400.0, 250.0, 0.0, 0.85)
    texts = [text.get_text() for text in axes.texts]
    assert texts == ["1500 rpm\n0.85 mm", "p0\nstable", "p1\ndoubtful", "p2\nnot stable", "p3\nunknown"]
    looks = {(line.get_marker(), line.get_color()) for line in axes.lines[2:]}
    assert len(looks) == len({mark for mark, _ in looks}) == 4


def test_words_in_a_picture_do_not_cover_one_another() -> None:
    figure, (axes,) = new_axes(1, (8.0, 4.2))
    axes.set(xlim=(0, 100), ylim=(0, 10))
    labels = LabelPlacer(axes)
    for place in ((50, 5), (52, 5), (50, 5.3)):
        labels.add("a program\nnot stable", place)
    figure.canvas.draw()
    boxes = [text.get_window_extent() for text in axes.texts]
    assert not any(one.overlaps(other) for one, other in combinations(boxes, 2))
