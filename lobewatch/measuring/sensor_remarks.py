"""The accelerometer taken off an FRF, and what is to be said of it."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from typing import NamedTuple

from acquisition import Frf, Remark, without_mass
from lobewatch.machine.settings.sensor_loading import SensorLoading
from modal import Extraction, Mode, Trust, mass_loading, trust_of, with_mass_doubt

USUAL_MASS = 0.010
"""Mass of an accelerometer that nobody named (kg): it is asked for where this one would matter."""
FIRST_ORDER = 0.1
"""Fall of a frequency up to which first order tells what a mass does to the stiffness; chosen."""
RESONANCES = {"magnet": 7000.0, "hand": 2000.0}
"""Resonance of an accelerometer (Hz) that is fixed so, about; with stud, glue or wax it lies beyond 20 kHz.

Source: Bruel & Kjaer, Measuring Vibration (1982), mounting the accelerometer."""
LEAST_BIAS = 0.01
"""Share of K from which its bias by the mounting is said."""


class Fitted(NamedTuple):
    """What a fit finds in an FRF."""

    state: Extraction
    """Extraction that the modes are of."""
    modes: tuple[Mode, ...]
    """Its modes."""
    remarks: tuple[Remark, ...] = ()
    """Remarks on the whole."""


def fit_without_sensor(frf: Frf, sensor: SensorLoading, fit: Callable[[Frf], Fitted]) -> Fitted:
    """What `fit` finds without the mass of the sensor, its doubt in the errors of the modes, and remarks on the sensor.

    Of a response that is not the driving point, where a trusted K is negative, nothing is taken off.
    """
    if not sensor.mass:
        state, modes, remarks = fit(frf)
        return Fitted(state, modes, (*remarks, *_about_sensor(modes, frf, sensor)))
    bare = without_mass(frf, sensor.mass)
    state, modes, remarks = fit(bare)
    if not _is_driving_point(modes):
        said = mass_stays(sensor, "not the driving point, a K is negative")
        state, modes, remarks = fit(frf)
        return Fitted(state, modes, (*remarks, said))
    modes = tuple(with_mass_doubt(mode, bare, sensor.mass_std) for mode in modes)
    said = Remark("sensor-mass-removed", "", f"{_grams(sensor)} are taken off")
    return Fitted(state, modes, (*remarks, said, *_about_mounting(modes, bare, sensor)))


def mass_stays(sensor: SensorLoading, why: str) -> Remark:
    """Remark that the mass of the sensor is not taken off."""
    return Remark("sensor-mass-stays", "", f"{_grams(sensor)} are not taken off: {why}")


def _grams(sensor: SensorLoading) -> str:
    return f"{1e3 * (sensor.mass or 0.0):.3g} ± {1e3 * sensor.mass_std:.1g} g of accelerometer and cable"


def _about_sensor(modes: Sequence[Mode], frf: Frf, sensor: SensorLoading) -> Iterator[Remark]:
    if sensor.mass is None:
        yield from _about_unknown_mass(modes, frf)
    yield from _about_mounting(modes, frf, sensor)


def _sure(modes: Sequence[Mode], frf: Frf) -> list[Mode]:
    """Trusted modes of an accelerometer at the driving point; none where one of them has a negative K."""
    trusted = [mode for mode in modes if trust_of(mode) is Trust.TRUSTED]
    return trusted if frf.measured_as == "accelerance" and _is_driving_point(trusted) else []


def _is_driving_point(modes: Sequence[Mode]) -> bool:
    return all(mode.is_driving_point for mode in modes if trust_of(mode) is Trust.TRUSTED)


def _about_unknown_mass(modes: Sequence[Mode], frf: Frf) -> Iterator[Remark]:
    loadings = [(mode, mass_loading(mode, frf, USUAL_MASS)) for mode in _sure(modes, frf)]
    felt = [pair for pair in loadings if -pair[1].frequency > pair[0].interval()[0, 1] / pair[0].frequency - 1]
    if felt:
        mode, loading = min(felt, key=lambda pair: pair[1].frequency)
        fall = 1 - (1 - 2 * loading.frequency) ** -0.5  # also where the modal mass is far below 10 g
        stiffness = f" and stiffness by {round(100 * loading.stiffness):+d} %" if fall < FIRST_ORDER else ""
        changes = f"the frequency by {-100 * fall:.2g} %{stiffness}"
        text = f"an accelerometer of {1e3 * USUAL_MASS:g} g would change {changes}, more than its interval"
        cure = "enter [tap] sensor_mass_g (0 where nothing rides on the structure), or --sensor-mass for a file"
        yield Remark("sensor-mass-unknown", f"{mode.frequency:.0f} Hz", f"{text}: its mass is not known", cure)


def _about_mounting(modes: Sequence[Mode], frf: Frf, sensor: SensorLoading) -> Iterator[Remark]:
    """The sensor reads 1/(1 - (f/f_m)^2) too much, f_m the resonance of its mass on its mounting."""
    if sensor.mounting is None or sensor.mounting in ("stud", "glue", "wax"):
        return
    resonance = RESONANCES[sensor.mounting or "magnet"]
    biased = [(mode, (mode.frequency / resonance) ** 2) for mode in _sure(modes, frf)]
    worst = [pair for pair in biased if pair[1] > max(LEAST_BIAS, pair[0].interval()[2, 1] / pair[0].stiffness - 1)]
    if worst:
        mode, bias = max(worst, key=lambda pair: pair[1])
        text = f"resonates at about {resonance / 1e3:g} kHz: K reads about {100 * min(bias, 1.0):.0f} % low"
        held = f"held by {sensor.mounting}" if sensor.mounting else "that is held by a magnet, which nobody says,"
        cure = "use a stud, glue or wax" if sensor.mounting else "enter [tap] mounting: stud, glue and wax are fine"
        yield Remark("mounting-resonance", f"{mode.frequency:.0f} Hz", f"an accelerometer {held} {text}", cure)
