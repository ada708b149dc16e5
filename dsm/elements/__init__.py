"""Beam elements as power series, and where the nodes are."""

from dsm.elements.beam_series import beam_series
from dsm.elements.element_series import MAX_X, TERMS, element_series
from dsm.elements.place_nodes import place_nodes

__all__ = [
    "MAX_X",
    "TERMS",
    "beam_series",
    "element_series",
    "place_nodes",
]
