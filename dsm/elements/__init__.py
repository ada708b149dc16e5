"""Beam elements as power series, and the nodes between them."""

from dsm.elements.beam_elements import Nodes, link_elements, place_nodes, stiffness_elements
from dsm.elements.element_series import (
    GAUSS_POINTS,
    MAX_ELEMENT_X,
    SERIES_TERMS,
    combine_rotary_terms,
    count_series_terms,
    element_series,
    transfer_series,
)

__all__ = [
    "GAUSS_POINTS",
    "MAX_ELEMENT_X",
    "SERIES_TERMS",
    "Nodes",
    "combine_rotary_terms",
    "count_series_terms",
    "element_series",
    "link_elements",
    "place_nodes",
    "stiffness_elements",
    "transfer_series",
]
