"""Replace two fitted modes by one if they are the halves of one uneven peak."""

from collections.abc import Iterator
from dataclasses import replace
from itertools import combinations

import numpy as np

from modal.arrays import Floats
from modal.bands.extraction import FittedBand, MergedPair
from modal.bands.fit_peaks import are_modes
from modal.bands.residual_analysis import has_rounding_residual, residual_near_mode
from modal.fitting.band_fit import BandFit
from modal.fitting.fit_band import fit_band

MAX_MERGED_RESIDUAL = 1 / 12
"""Largest residual (rms) near the mode that replaces a pair, over its peak; chosen."""
SPREAD_PEAK_PHASE = np.radians(20.0), np.radians(70.0)
"""Angles between the constants of the halves of a peak that is spread by drift or by smoothing of the lines (rad).

Drift over 1 and 3 half-widths gives 35 and 69 degrees. Modes of machine structures differ by a few degrees.
"""
OPPOSITE_PHASE = np.radians(90.0), np.radians(160.0)
"""Angles between the constants of the halves of a peak that moves during the decay, by its force for example (rad)."""
TURNED_PHASE_SIGNIFICANCE = 2.0
"""Standard errors that this angle must exceed."""
MIN_MODE_DISTANCE, MIN_OPPOSITE_DISTANCE = 0.25, 0.4
"""Least distance of two modes over the sum of their half-widths, and of two with opposite constants; chosen.

Closer ones nearly cancel, or are told apart only by a shape of the peak that no measured resonance has so exactly.
"""
MIN_SHAPE_MAC = 0.9
"""Least MAC over several FRFs of the halves of one peak; modes of their own have shapes of their own; chosen."""


def merge_phantom_pairs(band: FittedBand) -> FittedBand:
    """Merge pairs of overlapping modes that no two real modes are, until none is left.

    A resonance that moves during the measurement (drift, force), or was seen through a window or a smoothing of the
    lines, is no exact pole. The fit replaces it by two modes closer than their half-power widths. Such a pair is very
    close, or its constants are turned against each other. One mode that explains the peak replaces the two.
    """
    if has_rounding_residual(band):
        return band
    for i, j in overlapping_pairs(band.fit):
        merged = merge_pair(band, i, j) if _is_phantom(band.fit, i, j) else None
        if merged is not None:
            return merge_phantom_pairs(merged)
    return band


def overlapping_pairs(fit: BandFit) -> Iterator[tuple[int, int]]:
    """Yield the pairs of modes of a fit that are closer than their half-power widths and were not given."""
    half_width = np.prod(fit.poles, axis=0)
    for i, j in combinations(range(half_width.size), 2):
        is_near = abs(fit.frequency[i] - fit.frequency[j]) < half_width[i] + half_width[j]
        if is_near and not (fit.held[i] or fit.held[j]):
            yield i, j


def merge_pair(band: FittedBand, i: int, j: int, largest: float = MAX_MERGED_RESIDUAL) -> FittedBand | None:
    """Return the band with one mode in place of the modes i and j, its last one; None if one does not explain them.

    largest: residual near the one mode over its peak.
    """
    fit, data = band.fit, band.data
    share = np.abs(fit.constant[:, [i, j]]).sum(axis=0)
    middle = fit.poles[:, [i, j]] @ share / share.sum()
    starts = np.column_stack([np.delete(fit.poles, [i, j], axis=1), middle])
    height = np.append(np.delete(band.height, [i, j]), np.max(band.height[[i, j]]))
    one = fit_band(data.frequency, data.target, data.weight, starts, band.terms)
    if one is None or not np.all(are_modes(one, data.frequency, height)):
        return None
    pair = MergedPair(*np.sort(fit.frequency[[i, j]]).tolist())
    merged = replace(band, fit=one, height=height, merged=(*band.merged, pair))
    is_there = abs(one.frequency[-1] - middle[0]) < np.sum(np.prod(fit.poles[:, [i, j]], axis=0))
    return merged if is_there and residual_near_mode(merged, height.size - 1)[0] < largest else None


def _is_phantom(fit: BandFit, i: int, j: int) -> bool:
    """Return whether two overlapping modes have the constants of one uneven peak."""
    first, second = fit.constant[:, i], fit.constant[:, j]
    product = np.vdot(first, second)
    if abs(product) ** 2 < MIN_SHAPE_MAC * np.vdot(first, first).real * np.vdot(second, second).real:
        return False
    angle = float(abs(np.angle(product)))
    distance = abs(fit.frequency[i] - fit.frequency[j]) / np.sum(np.prod(fit.poles[:, [i, j]], axis=0))
    if distance < (MIN_OPPOSITE_DISTANCE if angle > np.pi / 2 else MIN_MODE_DISTANCE):
        return True
    is_turned = any(low < angle < high for low, high in (SPREAD_PEAK_PHASE, OPPOSITE_PHASE))
    turned = min(angle, np.pi - angle)
    return is_turned and turned > TURNED_PHASE_SIGNIFICANCE * _angle_error(fit, i, j)


def _angle_error(fit: BandFit, i: int, j: int) -> float:
    """Return the standard error of the angle between two constants, in the FRF that shows them best (rad)."""
    p, m = fit.constant.shape
    q = int(np.argmax(np.abs(fit.constant[:, i] * fit.constant[:, j])))
    places = np.array([i, j]) + (2 + p + q) * m
    slope: Floats = np.array([1.0, -1.0]) / np.abs(fit.constant[q, [i, j]])
    return float(np.sqrt(slope @ fit.covariance[np.ix_(places, places)] @ slope))
