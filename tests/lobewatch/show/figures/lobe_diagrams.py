"""Make lobe diagrams for tests."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from lobes import StabilityLobes
from lobewatch.arrays import Floats
from lobewatch.show.figures.lobe_figures import LobeDiagram


def diagram_of(speed_rpm: Floats, depths: Mapping[str, Floats], **parts: Any) -> LobeDiagram:
    """Return a diagram of limiting depths (m), the newest last."""
    *_, depth = depths.values()
    lobes = StabilityLobes(speed_rpm, depth, depth, np.full(depth.size, "hopf"), depth[:, np.newaxis], "zero order")
    return LobeDiagram("cut", lobes, depths, **parts)
