"""Correct FRFs for sensor mass and delay, and extract modes from decays without force."""

from collections.abc import Callable, Iterator, Sequence
from typing import NamedTuple

import modal
from acquisition import (
    Frf,
    Hit,
    Remark,
    extract_free_decay,
    remove_frf_delay,
    remove_hit_delay,
    remove_sensor_mass,
)
from lobewatch.machine.settings.setup_tables import SensorLoading
from modal import Extraction, Mode, Trust

TYPICAL_SENSOR_MASS = 0.010
"""Mass of a typical accelerometer (kg), assumed to decide whether an unknown mass matters."""
MAX_FIRST_ORDER_DROP = 0.1
"""Frequency drop up to which the first order predicts the change of stiffness; chosen."""
MOUNTING_RESONANCES = {"magnet": 7000.0, "hand": 2000.0}
"""Resonance of an accelerometer (Hz) for this mounting; above 20 kHz with stud, glue or wax.

Source: Bruel & Kjaer, Measuring Vibration (1982), mounting the accelerometer."""
MIN_REPORTED_BIAS = 0.01
"""Smallest bias of K by the mounting that is reported (-)."""


class FrfFit(NamedTuple):
    """Result of a mode fit."""

    extraction: Extraction
    """Extraction behind the modes."""
    modes: tuple[Mode, ...]
    """Fitted modes."""
    remarks: tuple[Remark, ...] = ()
    """Remarks on the fit."""


def fit_without_sensor_mass(frf: Frf, sensor: SensorLoading, fit: Callable[[Frf], FrfFit]) -> FrfFit:
    """Fit an FRF without the sensor mass, and propagate its uncertainty to the modes.

    The mass stays if a trusted K is negative, since the response is not the driving point then.
    """
    if not sensor.mass:
        state, modes, remarks = fit(frf)
        unknown = _unknown_mass_remarks(modes, frf) if sensor.mass is None else ()
        return FrfFit(state, modes, (*remarks, *unknown, *_mounting_remarks(modes, frf, sensor)))
    bare = remove_sensor_mass(frf, sensor.mass)
    state, modes, remarks = fit(bare)
    if not _is_driving_point(modes):
        remark = _mass_not_removed_remark(sensor, "sensor not at the driving point (a stiffness K is negative)")
        state, modes, remarks = fit(frf)
        return FrfFit(state, modes, (*remarks, remark))
    modes = tuple(modal.with_mass_uncertainty(mode, bare, sensor.mass_std) for mode in modes)
    remark = Remark("sensor-mass-removed", "", f"{_format_sensor_mass(sensor)} removed from the FRF")
    return FrfFit(state, modes, (*remarks, remark, *_mounting_remarks(modes, bare, sensor)))


def fit_on_time(
    frf: Frf, hits: tuple[Hit, ...], sensor: SensorLoading, fit: Callable[[Frf, Sequence[Hit]], FrfFit]
) -> tuple[Frf, tuple[Hit, ...], FrfFit]:
    """Fit an FRF without the sensor mass and without a delay of the response.

    Returns FRF and hits without the delay, and the fit.
    """
    found = fit_without_sensor_mass(frf, sensor, lambda bare: fit(bare, hits))
    credible = [mode for mode in found.modes if modal.assess_trust(mode) is not Trust.REJECTED]
    delay = modal.find_delay(found.extraction.frf, credible)
    if delay is None:
        return frf, hits, found
    frf, hits = remove_frf_delay(frf, delay), tuple(remove_hit_delay(hit, delay) for hit in hits)
    found = fit_without_sensor_mass(frf, sensor, lambda bare: fit(bare, hits))
    text = f"response is {1e3 * abs(delay):.3g} ms {'late' if delay > 0 else 'early'}: delay removed from the FRF"
    cure = "Record force and response with the same trigger and the same filters"
    remark = Remark("response-delay-removed", "", text, cure)
    return frf, hits, found._replace(remarks=(*found.remarks, remark))


def _mass_not_removed_remark(sensor: SensorLoading, why: str) -> Remark:
    """Return the remark that the sensor mass stays in the FRF."""
    return Remark("sensor-mass-stays", "", f"{_format_sensor_mass(sensor)} not removed: {why}")


def _format_sensor_mass(sensor: SensorLoading) -> str:
    return (
        f"{1e3 * (sensor.mass or 0.0):.3g} g of accelerometer and cable "
        f"(standard deviation {1e3 * sensor.mass_std:.1g} g)"
    )


def _trusted_driving_point_modes(modes: Sequence[Mode], frf: Frf) -> list[Mode]:
    """Return the trusted modes at the driving point; empty if one has a negative K."""
    trusted = [mode for mode in modes if modal.assess_trust(mode) is Trust.TRUSTED]
    return trusted if frf.measured_as == "accelerance" and _is_driving_point(trusted) else []


def _is_driving_point(modes: Sequence[Mode]) -> bool:
    return all(mode.is_driving_point for mode in modes if modal.assess_trust(mode) is Trust.TRUSTED)


def _unknown_mass_remarks(modes: Sequence[Mode], frf: Frf) -> Iterator[Remark]:
    trusted = _trusted_driving_point_modes(modes, frf)
    loadings = [(mode, modal.mass_loading(mode, frf, TYPICAL_SENSOR_MASS)) for mode in trusted]
    relevant = [pair for pair in loadings if -pair[1].frequency > pair[0].interval()[0, 1] / pair[0].frequency - 1]
    if relevant:
        mode, loading = min(relevant, key=lambda pair: pair[1].frequency)
        fall = 1 - (1 - 2 * loading.frequency) ** -0.5  # also where the modal mass is far below 10 g
        stiffness = f" and stiffness by {round(100 * loading.stiffness):+d} %" if fall < MAX_FIRST_ORDER_DROP else ""
        changes = f"the frequency by {-100 * fall:.2g} %{stiffness}"
        text = f"sensor mass unknown: {1e3 * TYPICAL_SENSOR_MASS:g} g would change {changes}, beyond the 95 % interval"
        cure = (
            "Enter [tap] sensor_mass_g (0 without a sensor on the structure), or give fit_file_modes.sensor for a file"
        )
        yield Remark("sensor-mass-unknown", f"{mode.frequency:.0f} Hz", text, cure)


def _mounting_remarks(modes: Sequence[Mode], frf: Frf, sensor: SensorLoading) -> Iterator[Remark]:
    """Yield a remark on the mounting, which overestimates acceleration by 1/(1 - (f/f_m)^2)."""
    if sensor.mounting is None or sensor.mounting in ("stud", "glue", "wax"):
        return
    resonance = MOUNTING_RESONANCES[sensor.mounting or "magnet"]
    biased = [(mode, (mode.frequency / resonance) ** 2) for mode in _trusted_driving_point_modes(modes, frf)]
    limits = (max(MIN_REPORTED_BIAS, mode.interval()[2, 1] / mode.stiffness - 1) for mode, _ in biased)
    worst = [pair for pair, limit in zip(biased, limits, strict=True) if pair[1] > limit]
    if worst:
        mode, bias = max(worst, key=lambda pair: pair[1])
        text = (
            f"resonance at about {resonance / 1e3:g} kHz makes stiffness K read about {100 * min(bias, 1.0):.0f} % low"
        )
        held = f"held by {sensor.mounting}" if sensor.mounting else "with unknown mounting (magnet assumed)"
        cure = (
            "Mount the accelerometer with a stud, glue or wax"
            if sensor.mounting
            else "Enter [tap] mounting (stud, glue or wax avoid this error)"
        )
        yield Remark("mounting-resonance", f"{mode.frequency:.0f} Hz", f"accelerometer {held}: {text}", cure)


NO_FORCE_CODE = "force-not-measured"
"""Code of the remark on free decays, which give no stiffness."""
MAX_DECAY_FREQUENCY_RATIO = 0.4
"""Share of the sample rate up to which spectra of decays are used, because of filters and aliases."""


def extract_decay_modes(hits: Sequence[Hit], band: tuple[float, float] | None = None) -> Extraction:
    """Extract the modes of hits without force, for `modal.modes_from_decays`.

    band: frequency range (Hz); None: up to `MAX_DECAY_FREQUENCY_RATIO`.
    """
    rate, decays = hits[0].sample_rate, [extract_free_decay(hit) for hit in hits]
    shortest = min(map(len, decays))
    spectra = modal.decay_spectra([decay[:shortest] for decay in decays], rate)
    return modal.extract_modes(spectra, band or (0.0, MAX_DECAY_FREQUENCY_RATIO * rate))


def decay_remarks(sensor: SensorLoading) -> list[Remark]:
    """Return the remarks on what free decays cannot tell."""
    text = "no force measured: only frequency and damping, no stiffness and no stability lobes"
    remark = Remark(NO_FORCE_CODE, "", text, "Tap with an instrumented hammer")
    return [remark, *([_mass_not_removed_remark(sensor, "the correction needs stiffness K")] if sensor.mass else [])]
