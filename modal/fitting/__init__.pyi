"""Least-squares fit of a few neighbouring modes in one FRF, or in several with common poles."""

from .band_fit import MAX_RESIDUAL_TERMS, MIN_RESIDUAL_TERMS, BandFit
from .fit_band import (
    fit_band,
    fit_real_constants,
    mode_pair_gain,
    refit_nearby,
    remove_residual_terms,
    residual_term_gain,
)

__all__ = [
    "MAX_RESIDUAL_TERMS",
    "MIN_RESIDUAL_TERMS",
    "BandFit",
    "fit_band",
    "fit_real_constants",
    "mode_pair_gain",
    "refit_nearby",
    "remove_residual_terms",
    "residual_term_gain",
]
