"""Plausible ranges of the numbers of machine.toml.

All ranges are chosen: what shops have, with room beside it, and where that can be had less than a factor of 1000 wide,
so that a slip of 1000 leaves them. docs/plausible.md says which slips are not seen.
"""

import math
from collections.abc import Iterator, Mapping
from enum import StrEnum
from typing import NamedTuple

from acquisition import Remark
from lobewatch.machine.settings import setup_tables as setup
from lobewatch.machine.settings import spindle_tables as model
from lobewatch.machine.settings.cut_tables import CutTable, DriveTable, MaterialTable, UncertaintyTable
from lobewatch.machine.settings.toml import TomlTable

KT_RANGE = (200.0, 6000.0)
"""Tangential cutting coefficient Kt (N/mm2)."""


class RatioRange(NamedTuple):
    """Plausible range of a number over another one."""

    low: float
    """Smallest plausible ratio."""
    high: float
    """Largest plausible ratio."""
    unit: str = "diameters"
    """Unit of the ratio in a sentence."""

    def holds(self, ratio: float) -> bool:
        return self.low <= ratio <= self.high


KR_RATIO_RANGE = RatioRange(0.01, 1.2, "times tangential_n_per_mm2")
"""Kr/Kt where it is not 0."""
STICK_OUT_RATIO_RANGE = RatioRange(0.8, 15.0)
"""Stick-out of a tool over its diameter."""
DEPTH_RATIO_RANGE = RatioRange(0.002, 2.0)
"""Axial depth of cut ap over diameter."""
FLUTE_LENGTH_RATIO_RANGE = RatioRange(0.2, 15.0)
"""Flute length over diameter."""
RADIAL_DEPTH_RATIO_RANGE = RatioRange(0.005, 1.0)
"""Radial depth of cut ae over diameter."""
CUTTING_SPEED_RANGE = RatioRange(3.0, 6000.0, "m/min at the edge")
"""Cutting speed (m/min), as a ratio to 1 m/min."""
GYRATION_RADIUS_RANGE = RatioRange(5.0, 500.0, "mm from the axis")
"""Radius of gyration of a lumped mass (mm), as a ratio to 1 mm."""
PLAUSIBLE_RANGES: Mapping[type[TomlTable], Mapping[str, tuple[float, float]]] = {
    setup.MachineTable: {"tap_interval_days": (0.5, 400)},
    setup.TapTable: {
        "record_s": (0.01, 9),
        "pre_trigger_s": (0.001, 0.9),
        "trigger_n": (0.2, 199),
        "position_mm": (1, 999),
        "stick_out_mm": (3, 1000),
        "drawbar_kn": (0.5, 150),
        **dict.fromkeys(("sensor_mass_g", "cable_mass_g"), (0.1, 99)),
        "sensor_band_hz": (100, 99_000),
    },
    setup.DaqTable: {"sample_rate_hz": (1000, 999_999), "calibration_interval_months": (1, 120)},
    setup.ChannelTable: {
        "range_v": (0.05, 40),
        "sensitivity_mv_per_n": (0.08, 30),
        "sensitivity_mv_per_g": (0.8, 799),
        "gain": (0.2, 199),
        "skew_us": (0.05, 49),
    },
    setup.ModeTable: {"band_hz": (5, 100_000)},
    setup.LimitsTable: {"frequency_warn_percent": (0.1, 60), "frequency_alarm_percent": (0.1, 60)},
    setup.SpeedTable: {"low_rpm": (10, 60_000), "high_rpm": (300, 250_000)},
    DriveTable: {"power_kw": (0.1, 99), "torque_nm": (0.05, 5000)},
    UncertaintyTable: {
        "frequency_percent": (0.01, 9),
        "damping_percent": (0.5, 100),
        "stiffness_percent": (0.1, 50),
        "speed_percent": (0.02, 10),
        "coefficients_percent": (1, 100),
        "predicted_frequency_percent": (0.1, 50),
        "predicted_damping_percent": (1, 100),
        "predicted_stiffness_percent": (0.5, 100),
        "untapped_frequency_percent": (0.1, 50),
        "untapped_stiffness_percent": (1, 100),
    },
    CutTable: {
        "teeth": (1, 40),
        "tool_diameter_mm": (0.3, 299),
        "helix_deg": (1, 70),
        "feed_per_tooth_mm": (0.002, 1.9),
        "tangential_n_per_mm2": KT_RANGE,
        "corner_radius_mm": (0.2, 199),
    },
    MaterialTable: {
        **dict.fromkeys(("tangential_n_per_mm2", "specific_force_n_per_mm2"), KT_RANGE),
        "force_angle_deg": (39, 90),
        **dict.fromkeys(("tangential_edge_n_per_mm", "radial_edge_n_per_mm"), (0.5, 400)),
    },
    model.SpindleTable: {
        "bearing_stiffness_n_per_um": (5, 4999),
        "youngs_modulus_gpa": (10, 700),
        "shear_modulus_gpa": (5, 300),
        "density_kg_per_m3": (1000, 20_000),
        "damping_ratio": (0.001, 0.3),
        "tool_length_mm": (3, 1000),
        "tolerance": (0.0002, 0.1),
    },
    model.SegmentTable: {
        **dict.fromkeys(("length_mm", "outer_mm", "bore_mm"), (0.6, 599)),
        **dict.fromkeys(("end_outer_mm", "end_bore_mm", "mass_outer_mm"), (0.6, 599)),
    },
    model.BearingTable: {
        "position_mm": (1, 999),
        "stiffness_n_per_um": (5, 4999),
        "damping_n_s_per_m": (5, 50_000),
        "rotational_stiffness_n_m_per_rad": (100, 9e6),
        "housing_stiffness_n_per_um": (5, 9999),
    },
    model.MassTable: {"position_mm": (1, 999), "mass_kg": (0.02, 199)},
    model.ToolTable: {
        "teeth": (1, 40),
        "diameter_mm": (0.3, 299),
        "helix_deg": (1, 70),
        "flute_length_mm": (0.5, 499),
        "cutting_speed_m_min": (5, 4999),
        "feed_per_tooth_mm": (0.002, 1.9),
        "max_speed_rpm": (300, 250_000),
    },
    model.JointTable: {
        "position_mm": (1, 999),
        "stiffness_n_per_um": (20, 1e5),
        "rotational_stiffness_n_m_per_rad": (1e4, 2e8),
    },
}
"""Ranges by table and key, in the units of the key; 0 and infinity stand for "none" and are not asked about."""
TEMPLATE_COEFFICIENTS, TEMPLATE_BEARING_STIFFNESS = (700.0, 250.0), 500.0
"""Kt and Kr (N/mm2), and bearing stiffness (N/um), of the template of machine.toml."""


class SettingFault(StrEnum):
    """Kind of an implausible setting; the value is the code of its remark."""

    OUT_OF_RANGE = "setting-not-plausible"
    """Number outside the plausible range."""
    CONTRADICTION = "settings-contradict"
    """Number that contradicts another one."""
    TEMPLATE_VALUE = "setting-guessed"
    """Number of the template that nobody has replaced."""


class ImplausibleSetting(NamedTuple):
    """Number of machine.toml that is probably a mistake."""

    fault: SettingFault
    """Kind of the mistake."""
    location: str
    """Table of the number, in words."""
    key: str
    """Key in that table."""
    value: str
    """Value of the key."""
    reason: str
    """Reason to doubt it."""

    @property
    def statement(self) -> str:
        """Line for [machine] accepted that confirms the number."""
        return " ".join(filter(None, [self.location, f"{self.key} = {self.value}"]))

    @property
    def remark(self) -> Remark:
        """Question about the number, with its remedy."""
        cure = f"correct it in machine.toml, or, where it is right: folder_updates.accept_settings {self.key}"
        return Remark(self.fault.value, self.location, f"{self.key} = {self.value} {self.reason}", cure)


def check_ranges(table: TomlTable, place: str) -> Iterator[ImplausibleSetting]:
    """Yield the numbers of a table that are outside of their plausible ranges; 0 and infinity mean "none"."""
    for kind, ranges in PLAUSIBLE_RANGES.items():
        for key, (low, high) in ranges.items() if isinstance(table, kind) else ():
            value = getattr(table, key, None)
            for item in value if isinstance(value, tuple) else (value,):
                if isinstance(item, bool) or not isinstance(item, int | float):
                    continue
                number = abs(item)
                if number != 0 and math.isfinite(number) and not low <= number <= high:
                    why = f"is outside {low:g} to {high:g}"
                    yield ImplausibleSetting(SettingFault.OUT_OF_RANGE, place, key, f"{number:g}", why)


def check_ratio(
    place: str, key: str, value: float, over: float, limits: RatioRange, unit: str = ""
) -> Iterator[ImplausibleSetting]:
    """Yield a number whose ratio to another one is outside its plausible range."""
    if value and not limits.holds(value / over):
        why = f"is {value / over:.3g} {unit or limits.unit}, not {limits.low:g} to {limits.high:g}"
        yield ImplausibleSetting(SettingFault.OUT_OF_RANGE, place, key, f"{value:g}", why)
