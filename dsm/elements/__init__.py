"""Beam elements as power series, and where the nodes are."""

from dsm.elements.beam_elements import link_elements, stiffness_elements
from dsm.elements.element_series import MAX_X, TERMS, element_series
from dsm.elements.place_nodes import Nodes, place_nodes
from dsm.elements.transfer_series import POINTS, transfer_series
from dsm.elements.whirl_terms import number_of_terms, whirl_terms

__all__ = [
    "MAX_X",
    "POINTS",
    "TERMS",
    "Nodes",
    "element_series",
    "link_elements",
    "number_of_terms",
    "place_nodes",
    "stiffness_elements",
    "transfer_series",
    "whirl_terms",
]
