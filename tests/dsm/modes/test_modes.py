"""Modes between their nodes: the same as with a node there."""

from __future__ import annotations

import pytest

from dsm import Bearing, Segment, Spindle, mode_shapes, modes_at
from dsm.modes.find_modes import find_modes

pytestmark = pytest.mark.quick

SHAFT = Spindle(
    (Segment(0.12, 0.05), Segment(0.2, 0.08, 0.03), Segment(0.1, 0.06)), (Bearing(0.15, 3e8), Bearing(0.38, 2e8))
)


@pytest.mark.parametrize("theory", ["euler-bernoulli", "timoshenko"])
@pytest.mark.parametrize("position", [0.0, 0.03, 0.11, 0.25, 0.399, 0.42])
def test_stiffness_between_nodes_is_that_of_a_node_there(position: float, theory: str) -> None:
    shaft = Spindle(SHAFT.segments, SHAFT.bearings, theory=theory)  # type: ignore[arg-type]
    _, expected = modes_at(shaft, 5, position)
    assert mode_shapes(shaft, 5).stiffness_at(position) == pytest.approx(expected, rel=1e-8)


def test_a_spinning_shaft_has_no_modal_stiffness() -> None:
    with pytest.raises(ValueError, match="spins at 500 rad/s"):
        find_modes(SHAFT, 3, spin=500.0).stiffness_at(0.0)
