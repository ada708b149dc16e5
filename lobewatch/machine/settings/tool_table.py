"""[[tool]] of machine.toml: what a tool is, what it bears, and its shape for the model."""

from __future__ import annotations

from typing import Annotated

from msgspec import Meta

from dsm import Spindle, change_tool
from lobes import ToolMaterial
from lobewatch.machine.settings.cut_tables import Range, pitch_of
from lobewatch.machine.settings.spindle_tables import MassTable, SegmentTable
from lobewatch.machine.settings.toml_table import Positive, Table


class ToolTable(Table, frozen=True):
    """[[tool]]: a tool; segments, from its tip to where it leaves the holder, are for one that the model predicts."""

    name: Annotated[str, Meta(min_length=1)]
    segments: tuple[SegmentTable, ...] = ()
    masses: tuple[MassTable, ...] = ()
    pitch_deg: tuple[float, ...] | None = None
    teeth: Annotated[int, Meta(ge=1)] | None = None
    diameter_mm: Positive | None = None
    helix_deg: Annotated[float, Meta(ge=0, lt=90)] | None = None
    flute_length_mm: Positive | None = None
    tool_material: ToolMaterial | None = None
    cutting_speed_m_min: Positive | Range | None = None
    feed_per_tooth_mm: Positive | Range | None = None
    max_speed_rpm: Positive | None = None

    def __post_init__(self) -> None:
        """Refuse pitches that are none, ranges that do not rise, and masses on nothing."""
        pitch_of(self.pitch_deg, self.teeth or len(self.pitch_deg or ()))
        for key in ("cutting_speed_m_min", "feed_per_tooth_mm"):
            value = getattr(self, key)
            if isinstance(value, tuple) and value[0] > value[1]:
                low, high = value
                raise ValueError(
                    f"{key}=[{low:g}, {high:g}] does not rise; give [least, greatest], or the greatest alone"
                )
        if self.masses and not self.segments:
            raise ValueError("masses without segments; give the shape of the tool too, or leave the masses out")

    def build(self, spindle: Spindle) -> Spindle:
        """The tool as a free shaft in SI units, of the spindle's theory and material where it names none."""
        return Spindle(
            [segment.build() for segment in self.segments],
            (),
            youngs_modulus=spindle.youngs_modulus,
            density=spindle.density,
            theory=spindle.theory,
            shear_modulus=spindle.shear_modulus,
            masses=[mass.build() for mass in self.masses],
        )

    def put_into(self, spindle: Spindle, tool_length_mm: float) -> Spindle:
        """The whole spindle with this tool in place of the one drawn."""
        return change_tool(spindle, tool_length_mm / 1e3, self.build(spindle))
