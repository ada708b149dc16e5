"""Edit the modes of an extraction by hand: drop one, add one, or fix its frequency and damping ratio."""

from dataclasses import dataclass, replace

import numpy as np

from modal.arrays import Floats
from modal.bands.extract_modes import limit_to_one_thread
from modal.bands.extraction import FIXED_MODE, Extraction, FittedBand, replace_band
from modal.bands.find_resonances import Resonance
from modal.bands.fit_peaks import MAX_PEAK_FIT_ERROR, are_modes, group_into_bands, iterate_bands, refit_real_constants
from modal.fitting.band_fit import MIN_RESIDUAL_TERMS
from modal.fitting.fit_band import fit_band
from modal.modes.mode_edits import ModeEdits
from modal.poles import select_physical_poles

EDITED_MODE_DISTANCE = 0.01
"""Relative distance up to which a frequency names a mode; chosen."""
SAME_MODE_HALF_WIDTHS = 0.25
"""Distance up to which a mode to be added exists already (half-power half-widths); chosen."""
TRIAL_DAMPING_RATIOS = (0.001, 0.003, 0.01, 0.03)
"""Start values of the damping ratio of an added mode, in addition to LSCF poles near it."""
MAX_ADDED_MODE_SHIFT = 0.05
"""Largest relative shift of an added mode from the given frequency, within its half-width; chosen."""
LONE_MODE_DAMPING = 0.02
"""Damping ratio that the band of a single added mode is laid for."""
ADDED_MODE = "added"
"""Mark of a mode that a person added."""


def edit_modes(state: Extraction, edits: ModeEdits) -> Extraction:
    """Drop, add and fix modes of an extraction, in this order.

    All modes of an edited band are fitted together again, and the others with their new tails.

    Parameters
    ----------
    state : Extraction
        Modes to be edited.
    edits : ModeEdits
        Frequencies of modes to drop, add and fix.

    Returns
    -------
    Extraction
        Edited modes; the same object for empty edits.

    Raises
    ------
    ValueError
        For a frequency outside the lines, a mode to drop that is not within 1 %, a place where no further mode
        fits, and a fixed mode that the FRF does not show.

    Examples
    --------
    >>> frf = synthesize_frf([Mode(500.0, 0.02, 2e7), Mode(900.0, 0.03, 5e7)], np.arange(1.0, 1501.0))
    >>> edited = edit_modes(extract_modes([frf]), ModeEdits(drop=(900.0,)))
    >>> [round(mode.frequency, 1) for mode in modes_from_extraction(edited)]  # Hz
    [500.0]
    """
    if not edits:
        return state
    with limit_to_one_thread():
        edited = state
        for frequency in edits.drop:
            edited = _drop_mode(edited, frequency)
        for frequency in edits.add:
            edited = _add_mode(edited, frequency)
        for frequency, zeta in edits.fix:
            edited = _fix_mode(edited, frequency, zeta)
        settled = iterate_bands(edited)
        bands = (b if b in state.bands else refit_real_constants(b) for b in settled.bands)
        return replace(settled, bands=tuple(bands))


@dataclass(frozen=True, eq=False)
class _EditPlan:
    """Modes to be fitted together."""

    band: FittedBand | None
    """Band to be replaced."""
    lines: slice
    poles: Floats
    """Start values, shape (2, m)."""
    words: tuple[str, ...]
    """Mark of what a person did to each mode."""

    def without(self, i: int) -> "_EditPlan":
        return replace(self, poles=np.delete(self.poles, i, axis=1), words=(*self.words[:i], *self.words[i + 1 :]))

    def with_mode(self, frequency: float, zeta: float, word: str) -> "_EditPlan":
        return replace(self, poles=np.column_stack([self.poles, [frequency, zeta]]), words=(*self.words, word))

    def fitted(self, state: Extraction) -> FittedBand | None:
        """Fit these modes; None if nothing fits."""
        data = state.data(self.lines, without=self.band)
        terms, resonances = (self.band.terms, self.band.resonances) if self.band else (MIN_RESIDUAL_TERMS, ())
        held = np.array([word == FIXED_MODE for word in self.words])
        fit = fit_band(data.frequency, data.target, data.weight, self.poles, terms, held)
        if fit is None:
            return None
        return FittedBand(data, resonances, np.zeros(held.size), fit, terms, edits=self.words)


def _drop_mode(state: Extraction, frequency: float) -> Extraction:
    request = f"drop {frequency:g} Hz"
    place = _find_mode(state, frequency)
    if place is None:
        modes = ", ".join(f"{mode:.0f}" for band in state.bands for mode in band.fit.frequency) or "none"
        raise ValueError(f"{request}: no mode within 1 % of this frequency. Choose one of the modes (Hz): {modes}.")
    band, i = place
    plan = _plan_for_band(band).without(i)
    if not plan.words:
        return replace_band(state, band, None)
    fitted = plan.fitted(state)
    if fitted is None:
        raise ValueError(f"{request}: the neighbouring modes cannot be fitted without this mode. Drop all these modes.")
    return replace_band(state, band, fitted)


def _add_mode(state: Extraction, frequency: float) -> Extraction:
    request, advice = f"add {frequency:g} Hz", "Check the plot of the FRF, or give the damping ratio too."
    plan = _plan_at_frequency(state, frequency, request)
    for known in plan.poles.T:
        if abs(known[0] - frequency) < SAME_MODE_HALF_WIDTHS * np.prod(known):
            raise ValueError(f"{request}: a mode at {known[0]:.1f} Hz exists. Change this mode with fix or drop.")
    tries = [plan.with_mode(*start, ADDED_MODE).fitted(state) for start in _start_values(state, plan, frequency)]
    fits = [fitted for fitted in tries if fitted is not None and _is_added_mode_near(fitted, frequency)]
    if not fits:
        raise ValueError(f"{request}: no mode fits at this frequency. {advice}")
    best = min(fits, key=lambda band: band.fit.sum_of_squares)
    if not are_modes(best.fit, best.data.frequency, best.height)[-1]:
        errors = best.fit.standard_error[1, -1] / best.fit.damping_ratio[-1], float(np.min(best.fit.size_error[:, -1]))
        mode = f"{best.fit.frequency[-1]:.1f} Hz has a standard error of {100 * max(errors):.0f} % in zeta or K"
        raise ValueError(f"{request}: the best fit at {mode}. {advice}")
    return replace_band(state, plan.band, best)


def _fix_mode(state: Extraction, frequency: float, zeta: float) -> Extraction:
    request = f"fix {frequency:g} Hz at zeta {100 * zeta:g} %"
    place = _find_mode(state, frequency)
    plan = _plan_for_band(place[0]).without(place[1]) if place else _plan_at_frequency(state, frequency, request)
    fitted = plan.with_mode(frequency, zeta, FIXED_MODE).fitted(state)
    if fitted is None or np.min(fitted.fit.size_error[:, -1]) > MAX_PEAK_FIT_ERROR:
        raise ValueError(f"{request}: the FRF shows no mode with these values. Check the figure of the FRF.")
    return replace_band(state, plan.band, fitted)


def _find_mode(state: Extraction, frequency: float) -> tuple[FittedBand, int] | None:
    """Return the band of a mode and its index there; None if no mode is near."""
    modes = [(band, i) for band in state.bands for i in range(band.fit.frequency.size)]
    distances = [abs(band.fit.frequency[i] / frequency - 1) for band, i in modes]
    nearest = int(np.argmin(distances)) if modes else 0
    return modes[nearest] if modes and distances[nearest] <= EDITED_MODE_DISTANCE else None


def _plan_for_band(band: FittedBand) -> _EditPlan:
    return _EditPlan(band, band.lines, band.fit.poles, band.edits or ("",) * band.fit.frequency.size)


def _plan_at_frequency(state: Extraction, frequency: float, request: str) -> _EditPlan:
    """Return the plan of the band that holds a frequency, or of a new one around it."""
    f = state.frf.frequency
    if not f[0] < frequency < f[-1]:
        raise ValueError(f"{request}: outside the measured band. Give a frequency from {f[0]:g} to {f[-1]:g} Hz.")
    for band in state.bands:
        if band.data.frequency[0] <= frequency <= band.data.frequency[-1]:
            return _plan_for_band(band)
    (alone,) = group_into_bands([Resonance(frequency, LONE_MODE_DAMPING * frequency, 0.0)], f)
    return _EditPlan(None, alone.lines, np.empty((2, 0)), ())


def _start_values(state: Extraction, plan: _EditPlan, frequency: float) -> list[tuple[float, float]]:
    poles = select_physical_poles(state.data(plan.lines, without=plan.band).chart)
    near = np.abs(poles.frequency / frequency - 1) < EDITED_MODE_DISTANCE
    from_poles = [*zip(poles.frequency[near].tolist(), poles.damping_ratio[near].tolist(), strict=True)]
    return [*from_poles, *((frequency, zeta) for zeta in TRIAL_DAMPING_RATIOS)]


def _is_added_mode_near(band: FittedBand, frequency: float) -> bool:
    """Return whether the mode added last is near the given frequency."""
    mode, zeta = band.fit.poles[:, -1]
    return bool(abs(mode / frequency - 1) <= max(EDITED_MODE_DISTANCE, min(zeta, MAX_ADDED_MODE_SHIFT)))
