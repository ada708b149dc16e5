"""Correct FRFs for sensor mass, and extract modes from decays without force."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from typing import NamedTuple

from acquisition import Frf, Hit, Remark, extract_free_decay, remove_sensor_mass
from lobewatch.machine.settings.setup_tables import SensorLoading
from modal import (
    Extraction,
    Mode,
    Trust,
    assess_trust,
    decay_spectra,
    extract_modes,
    mass_loading,
    with_mass_uncertainty,
)

TYPICAL_SENSOR_MASS = 0.010
"""Mass of an accelerometer that nobody named (kg): it is asked for where this one would matter."""
MAX_FIRST_ORDER_DROP = 0.1
"""Fall of a frequency up to which first order tells what a mass does to the stiffness; chosen."""
MOUNTING_RESONANCES = {"magnet": 7000.0, "hand": 2000.0}
"""Resonance of an accelerometer (Hz) that is fixed so, about; with stud, glue or wax it lies beyond 20 kHz.

Source: Bruel & Kjaer, Measuring Vibration (1982), mounting the accelerometer."""
MIN_REPORTED_BIAS = 0.01
"""Share of K from which its bias by the mounting is said."""


class FrfFit(NamedTuple):
    """What a fit finds in an FRF."""

    extraction: Extraction
    """Extraction that the modes are of."""
    modes: tuple[Mode, ...]
    """Its modes."""
    remarks: tuple[Remark, ...] = ()
    """Remarks on the whole."""


def fit_without_sensor_mass(frf: Frf, sensor: SensorLoading, fit: Callable[[Frf], FrfFit]) -> FrfFit:
    """What `fit` finds without the mass of the sensor, its doubt in the errors of the modes, and remarks on the sensor.

    Of a response that is not the driving point, where a trusted K is negative, nothing is taken off.
    """
    if not sensor.mass:
        state, modes, remarks = fit(frf)
        return FrfFit(state, modes, (*remarks, *_sensor_remarks(modes, frf, sensor)))
    bare = remove_sensor_mass(frf, sensor.mass)
    state, modes, remarks = fit(bare)
    if not _is_driving_point(modes):
        said = mass_not_removed_remark(sensor, "not the driving point, a K is negative")
        state, modes, remarks = fit(frf)
        return FrfFit(state, modes, (*remarks, said))
    modes = tuple(with_mass_uncertainty(mode, bare, sensor.mass_std) for mode in modes)
    said = Remark("sensor-mass-removed", "", f"{_format_sensor_mass(sensor)} are taken off")
    return FrfFit(state, modes, (*remarks, said, *_mounting_remarks(modes, bare, sensor)))


def mass_not_removed_remark(sensor: SensorLoading, why: str) -> Remark:
    """Remark that the mass of the sensor is not taken off."""
    return Remark("sensor-mass-stays", "", f"{_format_sensor_mass(sensor)} are not taken off: {why}")


def _format_sensor_mass(sensor: SensorLoading) -> str:
    return f"{1e3 * (sensor.mass or 0.0):.3g} ± {1e3 * sensor.mass_std:.1g} g of accelerometer and cable"


def _sensor_remarks(modes: Sequence[Mode], frf: Frf, sensor: SensorLoading) -> Iterator[Remark]:
    if sensor.mass is None:
        yield from _unknown_mass_remarks(modes, frf)
    yield from _mounting_remarks(modes, frf, sensor)


def _trusted_driving_point_modes(modes: Sequence[Mode], frf: Frf) -> list[Mode]:
    """Trusted modes of an accelerometer at the driving point; none where one of them has a negative K."""
    trusted = [mode for mode in modes if assess_trust(mode) is Trust.TRUSTED]
    return trusted if frf.measured_as == "accelerance" and _is_driving_point(trusted) else []


def _is_driving_point(modes: Sequence[Mode]) -> bool:
    return all(mode.is_driving_point for mode in modes if assess_trust(mode) is Trust.TRUSTED)


def _unknown_mass_remarks(modes: Sequence[Mode], frf: Frf) -> Iterator[Remark]:
    loadings = [
        (mode, mass_loading(mode, frf, TYPICAL_SENSOR_MASS)) for mode in _trusted_driving_point_modes(modes, frf)
    ]
    felt = [pair for pair in loadings if -pair[1].frequency > pair[0].interval()[0, 1] / pair[0].frequency - 1]
    if felt:
        mode, loading = min(felt, key=lambda pair: pair[1].frequency)
        fall = 1 - (1 - 2 * loading.frequency) ** -0.5  # also where the modal mass is far below 10 g
        stiffness = f" and stiffness by {round(100 * loading.stiffness):+d} %" if fall < MAX_FIRST_ORDER_DROP else ""
        changes = f"the frequency by {-100 * fall:.2g} %{stiffness}"
        text = f"an accelerometer of {1e3 * TYPICAL_SENSOR_MASS:g} g would change {changes}, more than its interval"
        cure = "enter [tap] sensor_mass_g (0 where nothing rides on the structure), or --sensor-mass for a file"
        yield Remark("sensor-mass-unknown", f"{mode.frequency:.0f} Hz", f"{text}: its mass is not known", cure)


def _mounting_remarks(modes: Sequence[Mode], frf: Frf, sensor: SensorLoading) -> Iterator[Remark]:
    """The sensor reads 1/(1 - (f/f_m)^2) too much, f_m the resonance of its mass on its mounting."""
    if sensor.mounting is None or sensor.mounting in ("stud", "glue", "wax"):
        return
    resonance = MOUNTING_RESONANCES[sensor.mounting or "magnet"]
    biased = [(mode, (mode.frequency / resonance) ** 2) for mode in _trusted_driving_point_modes(modes, frf)]
    worst = [
        pair for pair in biased if pair[1] > max(MIN_REPORTED_BIAS, pair[0].interval()[2, 1] / pair[0].stiffness - 1)
    ]
    if worst:
        mode, bias = max(worst, key=lambda pair: pair[1])
        text = f"resonates at about {resonance / 1e3:g} kHz: K reads about {100 * min(bias, 1.0):.0f} % low"
        held = f"held by {sensor.mounting}" if sensor.mounting else "that is held by a magnet, which nobody says,"
        cure = "use a stud, glue or wax" if sensor.mounting else "enter [tap] mounting: stud, glue and wax are fine"
        yield Remark("mounting-resonance", f"{mode.frequency:.0f} Hz", f"an accelerometer {held} {text}", cure)


NO_FORCE_CODE = "force-not-measured"
"""Code of the remark on a tap test of free decays, which tell no stiffness."""
MAX_DECAY_FREQUENCY_RATIO = 0.4
"""Share of the sample rate up to which the spectra of decays are used: beyond it filters and aliases begin."""


def extract_decay_modes(hits: Sequence[Hit], band: tuple[float, float] | None = None) -> Extraction:
    """Modes of hits without force, which `modal.modes_from_decays` reads; band (Hz), None: up to HIGHEST."""
    rate, decays = hits[0].sample_rate, [extract_free_decay(hit) for hit in hits]
    shortest = min(map(len, decays))
    return extract_modes(
        decay_spectra([decay[:shortest] for decay in decays], rate), band or (0.0, MAX_DECAY_FREQUENCY_RATIO * rate)
    )


def decay_remarks(sensor: SensorLoading) -> list[Remark]:
    """Remarks on what free decays do not tell; the mass of the sensor stays in them, for what it does needs K."""
    text = "no force was measured: frequency and damping are known, stiffness is not; no stability lobes, no depths"
    remark = Remark(NO_FORCE_CODE, "", text, "tap with a hammer that measures its force")
    return [remark, *([mass_not_removed_remark(sensor, "what they do needs K")] if sensor.mass else [])]
