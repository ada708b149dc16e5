"""Sensitivities printed for common impact hammers and accelerometers, by model.

Sources: data sheets of PCB Piezotronics (086, 352, 353 and 333 series), Bruel & Kjaer (8206, 4507 and 4508) and Kistler
(9722, 9724 and 9726). Force in mV/N, acceleration in mV/g, without gain.
"""

from collections.abc import Mapping

from acquisition import STANDARD_GRAVITY
from lobewatch.machine.journal.mass_checks import SensorChain
from lobewatch.machine.settings.setup_tables import ChannelTable, DaqTable


def _by_model(*sensitivities: tuple[float, str]) -> Mapping[str, float]:
    """Return the sensitivity of each model from pairs of a sensitivity and its models."""
    return {model: sensitivity for sensitivity, models in sensitivities for model in models.split(", ")}


HAMMER_SENSITIVITIES = _by_model(
    (22.5, "086E80, 8206"),
    (11.3, "086C01, 086C02, 8206-001"),
    (10.0, "9722A500"),
    (2.25, "086C03, 8206-002"),
    (2.0, "9722A2000, 9724A2000"),
    (1.13, "086C04, 8206-003"),
    (1.0, "9724A5000, 9726A5000"),
    (0.23, "086D05, 086D20, 086D50"),
    (0.2, "9726A20000"),
)
"""Sensitivity of each hammer model (mV/N)."""
ACCELEROMETER_SENSITIVITIES = _by_model(
    (100.0, "352C33, 352C34, 352C65, 352C68, 352A56, 333B30, 353B33, 4507 B, 4508 B"),
    (10.0, "352A21, 352C22, 352C03, 352C04, 352A60, 352B10, 353B03, 353B15, 353B18, 4507 B 001, 4508 B 001"),
    (5.0, "352C23"),
)
"""Sensitivity of each accelerometer model (mV/g)."""
MAX_MODEL_SENSITIVITY_DEVIATION = 0.15
"""Relative deviation of a single sensor from the sensitivity of its model; data sheets state 10 to 15 %."""


def fits_sensor_models(daq: DaqTable, chain: SensorChain) -> bool:
    """Tell whether [[daq.channel]] names the models of both sensors, and the sensitivities of a chain fit them.

    Tests from before a new calibration have their own sensitivities, which fit too. A gain in machine.toml is an
    amplifier, of which the model of a sensor says nothing.
    """
    inputs = (("force", chain.force_v_per_n), ("acceleration", chain.acceleration_v_per_m_s2))
    return all(
        any(table.quantity == quantity and _fits_model(table, sensitivity) for table in daq.channel)
        for quantity, sensitivity in inputs
    )


def _fits_model(table: ChannelTable, sensitivity: float) -> bool:
    """Tell whether the sensor model of a channel has about this sensitivity (V per SI unit)."""
    if table.gain != 1:
        return False
    printed = HAMMER_SENSITIVITIES.get(table.model, 0.0) / 1e3
    if table.quantity == "acceleration":
        printed = ACCELEROMETER_SENSITIVITIES.get(table.model, 0.0) / 1e3 / STANDARD_GRAVITY
    return printed > 0 and abs(abs(sensitivity) / printed - 1) <= MAX_MODEL_SENSITIVITY_DEVIATION
