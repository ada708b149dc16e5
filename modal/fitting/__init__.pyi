"""Least squares of a few neighbouring modes at once, in one FRF or in several with the same poles."""

from .band_fit import BandFit
from .fit_band import fit_band, values_nearby, with_real_constants
from .projected_band import beyond_terms, gain_of_a_pair, gain_of_a_term
from .residual_terms import LEAST_TERMS, MOST_TERMS

__all__ = [
    "LEAST_TERMS",
    "MOST_TERMS",
    "BandFit",
    "beyond_terms",
    "fit_band",
    "gain_of_a_pair",
    "gain_of_a_term",
    "values_nearby",
    "with_real_constants",
]
