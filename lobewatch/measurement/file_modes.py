"""Fit the modes of a recorded file and match them with other files."""

from collections.abc import Collection, Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

import acquisition
import modal
from acquisition import DataError, Description, Fact, Frf, Hit, HitDecision, HitFlags, Remark
from dsm import format_with_error
from lobewatch.machine import NO_MODE_EDITS
from lobewatch.machine.settings.setup_tables import SensorLoading
from lobewatch.measurement import exponential_window as windows
from lobewatch.measurement.file_frf import FileFrf, read_file_frf
from lobewatch.measurement.hit_remarks import drop_explained_remedies, find_hit_remarks
from lobewatch.measurement.recording_questions import check_quantity
from lobewatch.measurement.repeated_samples import repeated_samples_remarks
from lobewatch.measurement.sensor_effects import FrfFit, decay_remarks, extract_decay_modes, fit_on_time
from lobewatch.measurement.tap_measurement import mode_edits_remarks
from lobewatch.measurement.touch_remarks import touch_remarks
from modal import Extraction, Mode, ModeEdits

UNKNOWN_SENSOR = SensorLoading()
"""Accelerometer without any data."""
MAX_LISTED_PEAKS = 6
"""Largest number of peaks beyond the usable band that are listed one by one."""


@dataclass(frozen=True, eq=False)
class FileModes:
    """Modes of one recorded file."""

    path: Path
    """Path of the file."""
    frf: Frf | None
    """Average of its hits, or its FRF; None without force."""
    extraction: Extraction
    """Bands and fits of the mode extraction."""
    as_recorded: tuple[Mode, ...]
    """Modes by least squares, with the damping of an exponential window."""
    fitted: tuple[Mode, ...]
    """Modes by least squares, without the damping of the window."""
    picked: tuple[Mode, ...]
    """Modes by the peak picking of the paper, for comparison."""
    remarks: tuple[Remark, ...]
    """Remarks on all modes together and on missing ones."""
    facts: tuple[Fact, ...] = ()
    """Facts of the file with their origins."""
    by_hand: ModeEdits = NO_MODE_EDITS
    """Mode edits."""
    hits: tuple[HitFlags, ...] = ()
    """Faults of each hit of the file; empty if it contains only an FRF."""
    hit_flags: tuple[HitFlags, ...] = ()
    """Flags of these hits without accepted faults and after decisions; falsy for an averaged hit."""
    hit_decisions: tuple[HitDecision, ...] = ()
    """Decisions of a person on these hits."""
    n_found: int = 0
    """Number of hits found, with those that cannot be used; 0 for an FRF or if unknown."""
    places: tuple[str, ...] = ()
    """File and number of each hit in it, where the hits are of several files; empty otherwise."""


def fit_file_modes(
    path: Path,
    band: tuple[float, float] | None = None,
    *,
    window: windows.Window | None = None,
    conjugate: bool = False,
    accept: Collection[str] = (),
    description: Description | None = None,
    by_hand: ModeEdits = NO_MODE_EDITS,
    sensor: SensorLoading = UNKNOWN_SENSOR,
) -> FileModes:
    """Fit the modes of a recorded file.

    Three or more hits give standard errors. Hits that still ring at the end of the record get an exponential window,
    which is corrected: all hits if none is good, else only the ringing modes. Hits without force give no stiffness, no
    window correction and no mass correction.

    Parameters
    ----------
    path
        Recorded file.
    band
        Frequency range (Hz); None for the usable band.
    window
        Exponential window of the response to correct; None for that of the file.
    conjugate
        Whether the file contains the complex conjugate of response over force.
    accept
        Faults of hits to ignore, such as "not-decayed".
    description
        Data that the file lacks; the number of averages is inferred by default.
    by_hand
        Modes to add, to remove, or to hold.
    sensor
        Accelerometer whose mass is removed.

    Returns
    -------
    FileModes
        Modes with and without the window, peaks, and remarks.

    Raises
    ------
    ValueError
        For a window without the time of the hit, averages without coherence, unknown faults, or impossible mode edits.
    DataError
        If data of the file is missing or damaged.

    Examples
    --------
    >>> from pathlib import Path
    >>> from tempfile import TemporaryDirectory
    >>> modes = synthesize_frf([Mode(500.0, 0.02, 2e7)], np.arange(100.0, 1000.0))
    >>> with TemporaryDirectory() as folder:
    ...     new_table = np.column_stack([modes.frequency, modes.receptance.real, modes.receptance.imag])
    ...     names = "frequency [Hz],real [m/N],imag [m/N]"
    ...     np.savetxt(f"{folder}/frf.csv", new_table, delimiter=",", header=names, comments="")
    ...     read = fit_file_modes(Path(folder) / "frf.csv")
    >>> [f"{mode.frequency:.1f} Hz, K = {mode.stiffness / 1e6:.1f} N/um" for mode in read.fitted]
    ['500.0 Hz, K = 20.0 N/um']
    """
    file_frf = read_file_frf(path, accept, description or Description(), window, conjugate=conjugate)
    if file_frf.frf is None:
        if window is not None or conjugate:
            fields = "Window.time_constant, Window.hit_at and fit_file_modes.conjugate"
            raise ValueError(f"{fields} need a measured force. Leave out all three.")
        return _fit_decay_modes(path, file_frf, band, by_hand, sensor)
    frf, hits = file_frf.frf, file_frf.hits
    if conjugate:
        frf, hits = replace(frf, receptance=frf.receptance.conj()), ()
    window = windows.resolve_window(file_frf.recorded_window, window)
    delay, tau = 0.0, file_frf.time_constant
    if window is not None:
        delay, tau = window.delay(file_frf.hits), window.time_constant
        frf = acquisition.correct_windowed_receptance(frf, tau)
    edits = by_hand if tau is None else by_hand.with_window(tau)

    def fit(bare: Frf, of: Sequence[Hit]) -> FrfFit:
        state = modal.edit_modes(modal.extract_modes([bare], band), edits)
        return FrfFit(state, tuple(modal.modes_from_extraction(state, [of])), mode_edits_remarks(by_hand))

    frf, hits, (extraction, modes, fit_remarks) = fit_on_time(frf, hits, sensor, fit)
    mass, fitted = extraction.frf.mass_removed, modes
    frf = acquisition.remove_sensor_mass(frf, mass)
    if window is not None:
        record = 1 / float(np.mean(np.diff(frf.frequency)))
        fitted, windowed = windows.remove_recorded_window(modes, window.time_constant, delay, record)
    elif tau is not None:
        fitted, windowed = tuple(windows.remove_own_window(modes, tau)), ()
    else:
        windowed = tuple(windows.hidden_window_remarks(hits, modes))
        fitted, ringing = windows.refit_ringing_modes(modes, () if accept else hits, band, mass)
        windowed += ringing
    changes = tuple(find_hit_remarks(hits, band))
    modes, fitted = drop_explained_remedies(modes, changes), drop_explained_remedies(fitted, changes)
    found = (*_fit_remarks(modes, frf, band), *changes)
    found = (*repeated_samples_remarks(hits), *found)
    remarks = (*file_frf.remarks, *touch_remarks(hits), *fit_remarks, *windowed, *found)
    picked = tuple(modal.pick_peaks(frf, band))
    of_hits = file_frf.faults, file_frf.flags, file_frf.decisions, file_frf.n_found, file_frf.places
    return FileModes(path, frf, extraction, modes, fitted, picked, remarks, file_frf.facts, by_hand, *of_hits)


def _fit_decay_modes(
    path: Path, decays: FileFrf, band: tuple[float, float] | None, by_hand: ModeEdits, sensor: SensorLoading
) -> FileModes:
    """Fit the modes of hits without force; DataError if a window adds damping to them."""
    if decays.recorded_window is not None:
        raise DataError(f"{path}: the response has a window, which adds damping. Export the response without a window.")
    state = modal.edit_modes(extract_decay_modes(decays.hits, band), by_hand)
    changes = tuple(find_hit_remarks(decays.hits, band))
    modes = drop_explained_remedies(modal.modes_from_decays(state), changes)
    of_sensor = (*decay_remarks(sensor), *repeated_samples_remarks(decays.hits))
    fit_remarks = (*mode_edits_remarks(by_hand), *of_sensor, *_fit_remarks(modes, state.frf, band))
    remarks = (*decays.remarks, *fit_remarks, *changes)
    of_hits = decays.faults, decays.flags, decays.decisions, decays.n_found, decays.places
    return FileModes(path, None, state, modes, modes, (), remarks, decays.facts, by_hand, *of_hits)


def _fit_remarks(modes: Sequence[Mode], frf: Frf, band: tuple[float, float] | None) -> Iterator[Remark]:
    yield from check_modes_together(modes)
    for edge in modal.find_truncated_peaks(frf, modes, band):
        text = "a mode may be missing, because a peak is cut off at the edge of the band"
        yield Remark(
            "mode-missing-at-edge",
            f"{edge:.0f} Hz",
            text,
            "Widen the frequency band, with a harder hammer tip if necessary",
        )
    if band is None:
        yield from _peaks_beyond_remarks(frf)
    if not modes:
        yield make_no_mode_remark()


def make_no_mode_remark() -> Remark:
    """Return the remark on an FRF without any mode."""
    return Remark("no-mode", "", "no mode found", "Check the frequency band, and hit harder")


def _peaks_beyond_remarks(frf: Frf) -> Iterator[Remark]:
    """Yield a remark on peaks above the usable band."""
    peaks = modal.find_peaks_above_band(frf)
    if frf.usable_band is None or not peaks:
        return
    where = ", ".join(f"{frequency:.0f}" for frequency in peaks)
    if len(peaks) > MAX_LISTED_PEAKS:
        where = f"{len(peaks)} frequencies from {peaks[0]:.0f} to {peaks[-1]:.0f}"
    text = f"peaks at {where} Hz not fitted, because they are above the usable band ({frf.usable_band[1]:.0f} Hz)"
    yield Remark("peaks-beyond", "", text, "Use a harder hammer tip")


def check_modes_together(modes: Sequence[Mode]) -> list[Remark]:
    """Check all modes of an FRF together for a reversed sensor and a delayed channel.

    Parameters
    ----------
    modes
        Modes of one FRF.

    Returns
    -------
    list of Remark
        Remarks on wrong signs and on a common delay.
    """
    remarks: list[Remark] = []
    if check_quantity(modes) is not None:
        return remarks
    if len(modes) > 1 and not any(mode.is_driving_point for mode in modes):
        text = "stiffness K is negative for all modes, because hammer or sensor is mounted or wired in reverse"
        remarks.append(Remark("sign-swapped", "", text, "Reverse the sensor, or change the sign of its sensitivity"))
    delay = modal.common_delay(modes)
    if delay is not None:
        late = format_with_error(delay.skew, delay.skew_std, 1e-6)
        text = f"phase grows with frequency for all modes: response sampled {late} us late"
        cure = "Measure the delay with sensor_checks.check_skew, or add the delay to skew_us of the accelerometer"
        remarks.append(Remark("channel-delay", "", text, cure))
    return remarks


def list_comparison_files(
    beside: Sequence[str], file: Path, description: Description
) -> list[tuple[Path, Description]]:
    """List the files to compare with a recorded file.

    Parameters
    ----------
    beside
        Files, or numbers of other responses of the same file.
    file
        Recorded file.
    description
        Data that the files lack.

    Returns
    -------
    list of (Path, Description)
        Path and missing data of each measurement.
    """
    return [
        (file, replace(description, response=int(text)))
        if text.isdecimal()
        else (Path(text), replace(description, hit_files=()))
        for text in beside
    ]


def match_modes_across_files(file_modes: FileModes, beside: Sequence[str], others: Sequence[FileModes]) -> FileModes:
    """Count for each mode of a file how many other measurements show it.

    Parameters
    ----------
    file_modes
        Modes of the file.
    beside
        Names of the other measurements.
    others
        Modes of the other measurements.

    Returns
    -------
    FileModes
        The same modes with the counts.

    Raises
    ------
    ValueError
        If two measurements are identical.
    """
    numbers = [modes.extraction.frf.receptance for modes in (file_modes, *others)]
    for place, (text, new) in enumerate(zip(beside, numbers[1:], strict=True), 1):
        if any(np.array_equal(new, earlier) for earlier in numbers[:place]):
            problem = "same data as another measurement. Name a different measurement."
            raise ValueError(f"list_comparison_files.beside {text}: {problem}")
    found = [other.fitted for other in others]
    as_recorded, fitted = (modal.match_modes(modes, found) for modes in (file_modes.as_recorded, file_modes.fitted))
    return replace(file_modes, as_recorded=tuple(as_recorded), fitted=tuple(fitted))
