"""Fit modes to FRFs or free decays by weighted least squares."""

from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from acquisition import Frf, Hit, from_accelerance
from modal.arrays import Complexes, Floats
from modal.bands.edge_tails import edge_covariance
from modal.bands.extract_modes import extract_modes
from modal.bands.extraction import Extraction, FittedBand
from modal.bands.residual_analysis import systematic_error
from modal.fitting.band_fit import BandFit
from modal.hit_scatter import (
    HitCovariance,
    HitsOfFrf,
    add_linearity_remarks,
    decay_covariance,
    hit_covariances,
    leave_one_out_frfs,
    merge_scattered_decay_pairs,
    merge_scattered_pairs,
    single_hit_variance,
)
from modal.modes.mode import UNKNOWN_PHASE_STD_DEG, Mode, change_covariances, ratio_or_zero
from modal.quality.assess_mode import add_phase_remarks, add_smoothing_remarks, assess_mode
from modal.quality.quantity_remarks import add_quantity_remarks


def fit_modes(frf: Frf, band: tuple[float, float] | None = None, hits: Sequence[Hit] = ()) -> list[Mode]:
    """Fit the modes of an FRF by weighted least squares.

    Each resonance is fitted in a local band of some half-power widths, close ones together, with complex modal
    constants, which are real if Akaike's criterion allows. Modes without a peak of their own are added if the
    sum of squares asks for them, from LSCF poles that stay in place as the order grows. Complex residual terms
    represent modes outside the band, and the tails of all other fitted modes are subtracted. Lines are weighted by
    their
    random error (from a smoothed coherence), or equally in the measured quantity if it is unknown. The covariance is
    scaled by the reduced chi-square. A peak is left out if least squares does not converge to a mode inside its band
    or leaves its damping ratio or stiffness uncertain by more than a third; `pick_peaks` may still list it.

    Parameters
    ----------
    frf : Frf
        Measured FRF.
    band : tuple of float, optional
        Lowest and highest frequency (Hz). Default: all usable lines.
    hits : sequence of Hit, optional
        Hits that the FRF was averaged from (H1). With them the covariance includes the noise of the hammer, which is
        alike on neighbouring lines and so invisible to the fit. With three or more the modes also have a jackknife
        covariance over the hits, valid for any error that differs from hit to hit.

    Returns
    -------
    list of Mode
        Modes by rising frequency with covariance and remarks; may be empty.

    Raises
    ------
    ValueError
        For fewer than 8 usable lines, an FRF of zeros, a conjugated one, one without phase or without any coherence,
        and hits with other lines than the FRF or without a pulse.

    References
    ----------
    Peeters et al. (2004), Shock and Vibration 11, 395 (LSCF); Ewins, Modal Testing, ch. 4 (curve fitting
    with residual terms); Golub & Pereyra (1973), SIAM J. Numer. Anal. 10, 413.

    Examples
    --------
    >>> frf = synthesize_frf([Mode(500.0, 0.02, 2e7), Mode(520.0, 0.02, 4e7)], np.arange(1.0, 1501.0))
    >>> for mode in fit_modes(frf, band=(100.0, 1000.0)):
    ...     print(f"{mode.frequency:.2f} Hz, {mode.damping_ratio:.4f}, {mode.stiffness / 1e6:.2f} N/um")
    500.00 Hz, 0.0200, 20.00 N/um
    520.00 Hz, 0.0200, 40.00 N/um
    """
    return modes_from_extraction(extract_modes([frf], band), [hits])


def modes_from_extraction(state: Extraction, hits: Sequence[Sequence[Hit]] = ()) -> list[Mode]:
    """Return the modes of an extraction by rising frequency.

    Parameters
    ----------
    state : Extraction
        Result of `extract_modes` or `edit_modes`.
    hits : sequence of sequences of Hit, optional
        For each FRF the hits that it was averaged from.

    Returns
    -------
    list of Mode
        Modes with covariance, quality figures and remarks.

    Raises
    ------
    ValueError
        If the number of lists of hits differs from that of the FRFs, or hits have other lines or no pulse.

    Examples
    --------
    >>> state = extract_modes([synthesize_frf([Mode(500.0, 0.02, 2e7)], np.arange(1.0, 1501.0))])
    >>> [f"{mode.frequency:.1f} Hz" for mode in modes_from_extraction(state)]
    ['500.0 Hz']
    """
    return [mode for mode, _, _ in fit_constants(state, hits)]


def fit_constants(state: Extraction, hits: Sequence[Sequence[Hit]] = ()) -> list[tuple[Mode, Complexes, Floats]]:
    """Return the modes of an extraction by rising frequency, each with its modal constants and their covariance.

    Constants (m/N) have the shape (p,), the covariance of their relative sizes in the fit (p, p). Arguments as
    `modes_from_extraction`.
    """
    if hits and len(hits) != len(state.frfs):
        found = f"{len(hits)} lists of hits for {len(state.frfs)} FRFs"
        raise ValueError(f"{found}. Give one list of hits per FRF, even an empty list.")
    pairs = [(own, leave_one_out_frfs(own, frf)) for own, frf in zip(hits, state.frfs, strict=False)]
    state = merge_scattered_pairs(state, pairs)
    found_modes = [
        (mode, band.fit.constant[:, i], band.fit.size_covariance(i))
        for band in state.bands
        for i, mode in enumerate(_modes_with_scatter(state, band, pairs))
    ]
    rising = sorted(found_modes, key=lambda fitted: fitted[0].frequency)
    modes = add_phase_remarks([mode for mode, _, _ in rising])
    checked = add_quantity_remarks(state.frf, add_smoothing_remarks(state, modes, has_hits=any(hits)))
    return [(mode, constants, covariance) for mode, (_, constants, covariance) in zip(checked, rising, strict=True)]


def _modes_with_scatter(state: Extraction, band: FittedBand, pairs: Sequence[HitsOfFrf]) -> list[Mode]:
    by_hammer, over_hits = hit_covariances(state, band, pairs)
    modes = modes_from_band(state, band, by_hammer, over_hits)
    return add_linearity_remarks(state, band, modes, *pairs[0]) if over_hits else modes


def modes_from_band(
    state: Extraction, band: FittedBand, by_hammer: Floats | int, over_hits: HitCovariance | None
) -> list[Mode]:
    """Return the modes of one band with quality figures; the given covariances are in the order of `BandFit`."""
    fit, beyond = band.fit, systematic_error(band)
    noise, scatter = fit.covariance * beyond.factor + by_hammer, None
    common = beyond.covariance + edge_covariance(state, band)
    covariance = noise + common + np.diag(beyond.shape)
    if over_hits is not None:
        by_hits = over_hits.of_mean + np.diag(single_hit_variance(fit, noise, over_hits, beyond.shape))
        scatter = ModeScatter(by_hits + common, by_hits, over_hits.n_hits)
    freedom, f, p, m = beyond.degrees_of_freedom, band.data.frequency, len(state.frfs), band.height.size
    of, together = f" of {p} FRFs" if p > 1 else "", f", {m} modes together" if m > 1 else ""
    method = f"least squares{of}, {f[0]:.0f}..{f[-1]:.0f} Hz{together}"
    modes = [_mode_from_fit(fit, i, covariance, freedom, scatter) for i in range(fit.frequency.size)]
    return [assess_mode(state, band, i, replace(mode, method=method)) for i, mode in enumerate(modes)]


class ModeScatter(NamedTuple):
    """Covariance of a band over the hits, in the order of `BandFit`."""

    covariance: Floats
    """Covariance with systematic errors."""
    by_hits: Floats
    """Part of it that was estimated from the hits."""
    n_hits: int
    """Number of hits."""

    def freedom(self, fit: BandFit, i: int) -> float:
        """Return the degrees of freedom of mode i, the least of its values.

        Source: Welch (1947), Biometrika 34, 28; Satterthwaite (1946), Biometrics Bulletin 2, 110.
        """
        every, by_hits = (np.diag(_mode_covariance(part, fit, i))[:3] for part in (self.covariance, self.by_hits))
        share = np.max(ratio_or_zero(by_hits, every))
        return float((self.n_hits - 1) / share**2) if share > 0 else np.inf


def _mode_from_fit(fit: BandFit, i: int, cov: Floats, freedom: float, scatter: ModeScatter | None) -> Mode:
    """Return mode i of a band as seen at the driving point."""
    constant = complex(fit.constant[0, i])
    sign = 1.0 if constant.real > 0 else -1.0
    of_fit = _mode_covariance(cov, fit, i)
    over_hits = None if scatter is None else _mode_covariance(scatter.covariance, fit, i)
    best = of_fit if over_hits is None else over_hits
    error = np.sqrt(np.diag(best))
    error[3] = np.hypot(error[3], np.degrees(fit.phase_if_complex[0, i]))
    return Mode(
        float(fit.frequency[i]),
        float(fit.damping_ratio[i]),
        sign / abs(constant),
        of_fit[:3, :3],
        freedom,
        jackknife=None if over_hits is None else over_hits[:3, :3],
        n_hits=0 if scatter is None else scatter.n_hits,
        scatter_freedom=None if scatter is None else scatter.freedom(fit, i),
        phase_deg=float(np.degrees(np.angle(sign * constant))),
        phase_deg_std=min(float(error[3]), UNKNOWN_PHASE_STD_DEG),
        phase_correlation=ratio_or_zero(best[3, :3], error[3] * error[:3]),
        shape=_mode_shape(fit.constant[:, i]),
    )


def _mode_shape(constants: Complexes) -> Floats | None:
    """Return the part of each constant in phase with the driving point, scaled to 1 or -1; None for one FRF."""
    if constants.size == 1:
        return None
    along = np.real(constants * np.exp(-1j * np.angle(constants[0])))
    return np.asarray(along / np.max(np.abs(along)))


def _mode_covariance(covariance: Floats, fit: BandFit, i: int) -> Floats:
    """Return the covariance of frequency, damping ratio, stiffness and phase (degrees) of mode i, shape (4, 4)."""
    p, m = fit.constant.shape
    block = np.ix_(*2 * [[i, m + i, 2 * m + i, (2 + p) * m + i]])
    constant = fit.constant[0, i]
    by_size = -np.sign(constant.real) / abs(constant) ** 2
    scale = np.array([1.0, 1.0, by_size, np.degrees(1 / abs(constant))])
    return np.asarray(covariance[block] * np.outer(scale, scale))


def fit_common_modes(
    frfs: Sequence[Frf], band: tuple[float, float] | None = None, hits: Sequence[Sequence[Hit]] = ()
) -> list[Mode]:
    """Fit modes with common poles to several FRFs: directions, or points of a structure.

    As `fit_modes` with common frequencies and damping ratios, and a modal constant and residual terms
    for each FRF. A mode counts if one of the FRFs shows it.

    Parameters
    ----------
    frfs : sequence of Frf
        FRFs with one frequency axis. The first is the driving point, which stiffness and covariance belong to.
    band : tuple of float, optional
        Lowest and highest frequency (Hz). Default: all usable lines.
    hits : sequence of sequences of Hit, optional
        For each FRF the hits that it was averaged from (H1), maybe none. If all have three or more, the modes have a
        jackknife that leaves out one hit of one FRF at a time, which takes the FRFs as measured independently.

    Returns
    -------
    list of Mode
        Modes by rising frequency, each with its shape over the FRFs; may be empty. `n_hits` is that of the
        FRF with the fewest hits.

    Raises
    ------
    ValueError
        As `fit_modes`, for no FRF, for FRFs with different lines, and if the number of lists of hits differs from
        that of the FRFs.

    Examples
    --------
    >>> line = np.arange(1.0, 1001.0)
    >>> tip, nose = synthesize_frf([Mode(500.0, 0.02, 2e7)], line), synthesize_frf([Mode(500.0, 0.02, -4e7)], line)
    >>> (mode,) = fit_common_modes([tip, nose])
    >>> f"{mode.frequency:.1f} Hz, K = {mode.stiffness / 1e6:.1f} N/um, shape {mode.shape.round(3).tolist()}"
    '500.0 Hz, K = 20.0 N/um, shape [1.0, -0.5]'
    """
    return modes_from_extraction(extract_modes(frfs, band), hits)


STIFFNESS_REMARK_CODES = ("not-driving-point", "near-node")
"""Codes of remarks on sign and size of K, which free decays do not show."""


def fit_decays(decays: ArrayLike, sample_rate: float, band: tuple[float, float] | None = None) -> list[Mode]:
    """Fit the modes of free decays, whose force was not measured.

    Calls `decay_spectra`, `extract_modes` and `modes_from_decays` one after the other.

    Parameters
    ----------
    decays : array_like, shape (p, n)
        Accelerations of p free decays after hits at one point in one direction (m/s^2).
    sample_rate : float
        Sample rate (Hz).
    band : tuple of float, optional
        Lowest and highest frequency (Hz).

    Returns
    -------
    list of Mode
        Modes by rising frequency; may be empty. K is NaN, for it needs the force.

    Raises
    ------
    ValueError
        As `fit_modes`, and for decays of zeros, values that are not finite, or fewer than 32 samples.

    Examples
    --------
    >>> time = np.arange(2048) / 10240.0  # s
    >>> decay = np.exp(-0.02 * 2 * np.pi * 500.0 * time) * np.cos(2 * np.pi * 500.0 * np.sqrt(1 - 0.02**2) * time)
    >>> (mode,) = fit_decays([300.0 * decay, 200.0 * decay, 250.0 * decay], 10240.0)  # m/s^2, Hz
    >>> f"{mode.frequency:.2f} Hz, {mode.damping_ratio:.4f}, K {mode.stiffness}"
    '500.00 Hz, 0.0200, K nan'
    """
    return modes_from_decays(extract_modes(decay_spectra(decays, sample_rate), band))


def decay_spectra(decays: ArrayLike, sample_rate: float) -> list[Frf]:
    """Return the spectra of free decays, each as the FRF of a force of 1 N s at its first sample.

    The spectrum of a decay that begins at once and has ended with the record is the sum of r / (i w - lambda): the
    poles are those of the structure. Hammer and hit time affect only r, which differs from decay to decay. So the
    spectra are fitted together with common poles and never averaged. A force that lasts beyond the first sample is
    smooth over the lines of a mode and does not move its pole either.

    Parameters
    ----------
    decays : array_like, shape (p, n)
        Accelerations of p free decays (m/s^2).
    sample_rate : float
        Sample rate (Hz).

    Returns
    -------
    list of Frf
        One spectrum per decay.

    Raises
    ------
    ValueError
        For fewer than 32 samples, values that are not finite, and decays of one value.

    References
    ----------
    Ewins, Modal Testing, ch. 2 and 4; Brown, Allemang, Zimmerman & Mergeay (1979), SAE paper 790221.

    Examples
    --------
    >>> time = np.arange(2048) / 10240.0  # s
    >>> decay = np.exp(-0.02 * 2 * np.pi * 500.0 * time) * np.sin(2 * np.pi * 500.0 * time)
    >>> (spectrum,) = decay_spectra([300.0 * decay], 10240.0)
    >>> float(spectrum.frequency[abs(spectrum.accelerance).argmax()]), spectrum.measured_as  # Hz
    (500.0, 'accelerance')
    """
    records = np.atleast_2d(np.asarray(decays, dtype=np.float64))
    if records.ndim != 2 or records.shape[1] < 32:
        raise ValueError(f"decays have shape {records.shape}. Give (p, n) with n of at least 32 samples.")
    if not np.all(np.isfinite(records)) or not np.all(np.ptp(records, axis=1)):
        raise ValueError("a decay is constant or has values that are not finite. Leave this decay out.")
    frequency = np.fft.rfftfreq(records.shape[1], 1 / sample_rate)
    return [from_accelerance(frequency, np.fft.rfft(record) / sample_rate) for record in records]


def modes_from_decays(state: Extraction) -> list[Mode]:
    """Return the modes of an extraction from `decay_spectra` by rising frequency.

    With three decays or more the errors come from the scatter of the decays: each one moves the common values by its
    part of a Gauss-Newton step (a sandwich estimate with the decays as clusters).

    Parameters
    ----------
    state : Extraction
        Extraction of decay spectra.

    Returns
    -------
    list of Mode
        Modes without stiffness.

    References
    ----------
    Liang & Zeger (1986), Biometrika 73, 13.
    """
    state = merge_scattered_decay_pairs(state)
    pairs = [pair for band in state.bands for pair in _decay_modes(state, band)]
    highest = max((height for _, height in pairs), default=1.0)
    modes = [_drop_stiffness(mode, height / highest) for mode, height in pairs]
    return sorted(modes, key=lambda mode: mode.frequency)


def _decay_modes(state: Extraction, band: FittedBand) -> Sequence[tuple[Mode, float]]:
    """Return the modes of a band with their peak heights, rms over the decays."""
    scatter = decay_covariance(band)
    modes = modes_from_band(state, band, 0, scatter)
    heights = np.sqrt(np.mean(np.abs(band.fit.constant) ** 2, axis=0)) / (2 * band.fit.damping_ratio)
    return list(zip(modes, heights.tolist(), strict=True))


def _drop_stiffness(mode: Mode, relative_peak: float) -> Mode:
    """Remove the values of a mode that need the force."""
    return replace(
        change_covariances(mode, _pole_covariance),
        stiffness=np.nan,
        phase_deg=0.0,
        phase_deg_std=0.0,
        phase_correlation=None,
        shape=None,
        relative_peak=relative_peak,
        remarks=tuple(remark for remark in mode.remarks if remark.code not in STIFFNESS_REMARK_CODES),
    )


def _pole_covariance(covariance: Floats) -> Floats:
    """Return the covariance with NaN for the stiffness."""
    known = np.full((3, 3), np.nan)
    known[:2, :2] = covariance[:2, :2]
    return known
