"""Tables of machine.toml on cutting: reference cut, programs, materials, drive and uncertainty."""

import math
from collections.abc import Sequence
from typing import Annotated, Literal

from msgspec import Meta

from lobes import CuttingCoefficients, Direction, tangential_and_radial
from lobes.cut import normalize_pitch
from lobewatch.machine.settings.toml import NotNegative, Plausible, Positive, PositiveOrInfinite, TomlTable

FEED_ANGLES = {"x": 0.0, "y": math.pi / 2}
"""Angle from x to the feed (rad) by axis."""
MAX_ENGAGEMENT_STEP = math.radians(15)
"""Largest step between the engagement angles along a path (rad)."""
ValueRange = Annotated[tuple[Positive, ...], Meta(min_length=2, max_length=2)]
"""Lower and upper limit. msgspec 0.22 misreads the fixed length `tuple[A, B]` in a union with a number."""
CuttingPressure = Annotated[Positive, Plausible(200, 6000)]
"""Tangential cutting coefficient Kt, or specific cutting force (N/mm2)."""
ProcessDamping = Annotated[tuple[NotNegative, ...], Meta(min_length=2, max_length=2), Plausible(2e3, 1.9e6)]
"""Lowest and highest process damping coefficient C (N/m)."""
ToolWear = Literal["new", "used", "worn"]
"""Wear of the cutting edges."""


def convert_pitch(pitch_deg: Sequence[float] | None, teeth: int) -> tuple[float, ...]:
    """Convert pitch angles to radians, () for equal pitch; ValueError for invalid pitches."""
    return normalize_pitch([math.radians(angle) for angle in pitch_deg or ()], teeth)


def _check_rising(name: str, limits: Sequence[float] | None) -> None:
    """Raise ValueError for limits that are not in rising order."""
    if limits is not None and limits[0] > limits[-1]:
        raise ValueError(f"{name}=[{limits[0]:g}, {limits[-1]:g}] is not in rising order. Give [smallest, largest].")


def corner_engagement(tool: float, radial: float, corner: float) -> float:
    """Return the engagement angle (rad) of a tool radius in a corner; all lengths in one unit.

    radial: radial depth on the straight before the corner; corner: remaining radius of the corner, at least that of the
    tool. The wall before the corner is an arc about the same centre: law of cosines between the two centres and their
    intersection.
    """
    path = corner - tool
    if path == 0:
        return math.pi
    cosine = ((corner - radial) ** 2 - path**2 - tool**2) / (2 * path * tool)
    return math.acos(max(cosine, -1.0))


def _immersion_steps(least: float, most: float) -> tuple[float, ...]:
    """Return rising immersions between two, at most `MAX_ENGAGEMENT_STEP` of engagement apart."""
    low, high = (math.acos(1 - 2 * immersion) for immersion in (least, most))
    steps = math.ceil((high - low) / MAX_ENGAGEMENT_STEP - 1e-9)
    between = [(1 - math.cos(low + (high - low) * i / steps)) / 2 for i in range(1, steps)]
    return (least, *between, *([most] if steps else []))


class CutTable(TomlTable, frozen=True):
    """Table [reference_cut], and the shared part of a program.

    >>> pocket = CutTable(4, (2.0, 8.0), 16.0, "down", material="AA 7075")  # radial depth 2 to 8 mm
    >>> pocket.immersion, pocket.feed_axes
    (0.5, ('x', 'y'))
    """

    teeth: Annotated[int, Meta(ge=1), Plausible(1, 40)]
    """Number of teeth (flutes)."""
    radial_depth_mm: Positive | ValueRange
    """Radial depth of cut ae (mm), or its range along the path."""
    tool_diameter_mm: Annotated[Positive, Plausible(0.3, 299)]
    """Tool diameter (mm)."""
    direction: Direction
    """Direction of milling, "up" (conventional) or "down" (climb)."""
    material: str | None = None
    """Name of the material, built-in or of a [[material]]."""
    tangential_n_per_mm2: CuttingPressure | None = None
    """Tangential cutting coefficient Kt (N/mm2); None: that of the material."""
    radial_n_per_mm2: NotNegative | None = None
    """Radial cutting coefficient Kr (N/mm2); None: that of the material."""
    helix_deg: Annotated[float, Meta(ge=0, lt=90), Plausible(1, 70)] | None = None
    """Helix angle (deg); None for straight flutes."""
    feed_per_tooth_mm: Annotated[Positive, Plausible(0.002, 1.9)] | None = None
    """Feed per tooth (mm); None: torque is unknown."""
    flute_length_mm: Positive | None = None
    """Flute length (mm)."""
    pitch_deg: tuple[float, ...] | None = None
    """Angles from tooth to tooth (deg); None for equal pitch."""
    feed: str = "both"
    """Axis of the feed, "x", "y" or "both"."""
    process_damping_n_per_m: ProcessDamping | None = None
    """Lowest and highest process damping coefficient C (N/m); None: that of the material, else unknown."""

    @property
    def feed_axes(self) -> tuple[str, ...]:
        """Axes of the feed."""
        return tuple(FEED_ANGLES) if self.feed == "both" else (self.feed,)

    @property
    def radial_mm(self) -> tuple[float, float]:
        """Smallest and largest radial depth on the straight path (mm)."""
        depths = self.radial_depth_mm if isinstance(self.radial_depth_mm, tuple) else (self.radial_depth_mm,)
        return depths[0], depths[-1]

    @property
    def immersion(self) -> float:
        """Largest radial depth on the straight path over diameter (-)."""
        return self.radial_mm[1] / self.tool_diameter_mm

    @property
    def immersions(self) -> tuple[float, ...]:
        """Rising immersions along the path (-)."""
        return _immersion_steps(self.radial_mm[0] / self.tool_diameter_mm, self.immersion)

    @property
    def deepest_mm(self) -> float:
        """Flute length, else the diameter (mm)."""
        return self.tool_diameter_mm if self.flute_length_mm is None else self.flute_length_mm

    def __post_init__(self) -> None:
        _check_rising("radial_depth_mm", self.radial_mm)
        _check_rising("process_damping_n_per_m", self.process_damping_n_per_m)
        most = self.radial_mm[1]
        if most > self.tool_diameter_mm:
            raise ValueError(f"radial_depth_mm={most:g} is larger than tool_diameter_mm={self.tool_diameter_mm:g}")
        missing = {self.tangential_n_per_mm2 is None, self.radial_n_per_mm2 is None}
        if len(missing) == 2 or (missing == {True} and self.material is None):
            cure = "Give material, or both tangential_n_per_mm2 and radial_n_per_mm2, or all three."
            raise ValueError(f"cutting coefficients are incomplete. {cure}")
        if self.feed not in (*FEED_ANGLES, "both"):
            raise ValueError(f'unknown feed direction {self.feed!r}. Give "x", "y" or "both".')
        convert_pitch(self.pitch_deg, self.teeth)


class ProgramTable(CutTable, frozen=True, kw_only=True):
    """Table [[program]]: a cut that the shop runs; NaN for a speed or depth that is requested.

    >>> program = ProgramTable(4, 8.0, 16.0, "down", material="AA 7075", name="A", speed_rpm=12000.0)
    >>> program.is_incomplete  # the depth is requested
    True
    >>> round(program.corner_immersion(20.0), 3)  # radial depth over diameter in a corner of 20 mm, 0.5 on the straight
    0.667
    """

    name: Annotated[str, Meta(min_length=1)]
    """Unique name."""
    tool: str = "reference"
    """Name of the tool."""
    speed_rpm: Positive = math.nan
    """Spindle speed (rpm); NaN if requested."""
    depth_mm: Positive = math.nan
    """Axial depth of cut ap (mm); NaN if requested."""
    corner_radius_mm: Annotated[Positive, Plausible(0.2, 199)] | None = None
    """Radius of the tightest corner on the path (mm); None for a straight path."""
    wear: ToolWear | None = None
    """Allowed tool wear; None: that of [doubt]."""
    wear_land_um: Annotated[Positive, Plausible(5, 999)] | None = None
    """Width of the wear land on the flank (um); None if unknown."""
    thin: bool = False
    """True if the cut wall is flexible: then the verdict is never stable."""

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.flute_length_mm is not None and self.depth_mm > self.flute_length_mm:
            raise ValueError(f"depth_mm={self.depth_mm:g} is larger than flute_length_mm={self.flute_length_mm:g}")
        if self.corner_radius_mm is not None:
            self.corner_immersion(self.corner_radius_mm)

    @property
    def is_incomplete(self) -> bool:
        """True if speed or depth is requested."""
        return math.isnan(self.speed_rpm) or math.isnan(self.depth_mm)

    @property
    def immersions(self) -> tuple[float, ...]:
        """Rising immersions along the path and into its corners (-)."""
        if self.corner_radius_mm is None:
            return super().immersions
        return _immersion_steps(self.radial_mm[0] / self.tool_diameter_mm, self.corner_immersion(self.corner_radius_mm))

    def corner_immersion(self, radius_mm: float) -> float:
        """Return the immersion of a straight cut with the same engagement as this one in a corner.

        Parameters
        ----------
        radius_mm
            Remaining radius of the corner (mm).

        Raises
        ------
        ValueError
            For a corner tighter than the tool.
        """
        tool = self.tool_diameter_mm / 2
        if radius_mm < tool:
            cure = "Give the radius of the finished corner, or a smaller tool."
            raise ValueError(f"corner_radius_mm={radius_mm:g} is smaller than the tool radius {tool:g} mm. {cure}")
        return (1 - math.cos(corner_engagement(tool, self.radial_mm[1], radius_mm))) / 2

    @property
    def deepest_mm(self) -> float:
        """Flute length, else the diameter or the present depth (mm)."""
        return max(super().deepest_mm, 0.0 if math.isnan(self.depth_mm) else self.depth_mm)


class MaterialTable(TomlTable, frozen=True):
    """Table [[material]]: Ktc and Krc, or Ks and beta, with edge coefficients if known."""

    name: Annotated[str, Meta(min_length=1)]
    tangential_n_per_mm2: CuttingPressure | None = None
    radial_n_per_mm2: NotNegative | None = None
    specific_force_n_per_mm2: CuttingPressure | None = None
    force_angle_deg: Annotated[float, Meta(gt=0, le=90), Plausible(39, 90)] | None = None
    tangential_edge_n_per_mm: Annotated[NotNegative, Plausible(0.5, 400)] = math.nan
    radial_edge_n_per_mm: Annotated[NotNegative, Plausible(0.5, 400)] = math.nan
    process_damping_n_per_m: ProcessDamping | None = None
    """Lowest and highest process damping coefficient C (N/m); None if unknown."""
    source: str = "machine.toml"
    iso_group: Literal["P", "M", "K", "N", "S", "H"] | None = None
    """Group of materials by ISO 513."""

    def __post_init__(self) -> None:
        first, second = ("tangential_n_per_mm2", "radial_n_per_mm2"), ("specific_force_n_per_mm2", "force_angle_deg")
        counts = [sum(getattr(self, key) is not None for key in pair) for pair in (first, second)]
        if sorted(counts) != [0, 2]:
            cure = f"Give either {' and '.join(first)}, or {' and '.join(second)}."
            raise ValueError(f"cutting coefficients do not fit together. {cure}")
        _check_rising("process_damping_n_per_m", self.process_damping_n_per_m)

    def build(self) -> CuttingCoefficients:
        """Build the coefficients in SI units."""
        tangential, radial = self.tangential_n_per_mm2, self.radial_n_per_mm2
        if self.specific_force_n_per_mm2 is not None and self.force_angle_deg is not None:
            angle = math.radians(self.force_angle_deg)
            tangential, radial = tangential_and_radial(self.specific_force_n_per_mm2, angle)
        pressures = (tangential or 0.0) * 1e6, (radial or 0.0) * 1e6
        edges = self.tangential_edge_n_per_mm * 1e3, self.radial_edge_n_per_mm * 1e3
        iso_group = self.iso_group or ""
        return CuttingCoefficients(self.name, *pressures, *edges, source=self.source, iso_group=iso_group)


class DriveTable(TomlTable, frozen=True):
    """Table [drive]: power and torque of the spindle motor."""

    power_kw: Annotated[PositiveOrInfinite, Plausible(0.1, 99)] = math.inf
    torque_nm: Annotated[PositiveOrInfinite, Plausible(0.05, 5000)] = math.inf


Percent = Annotated[float, Meta(ge=0, le=100)]


class UncertaintyTable(TomlTable, frozen=True):
    """Table [doubt]: half-widths (%) of independent uniform distributions; defaults: docs/lobes.md."""

    frequency_percent: Annotated[Percent, Plausible(0.01, 9)] | None = None
    """Natural frequency from test to test; None: scatter of the series from 8 tests on, before that 0.3."""
    damping_percent: Annotated[Percent, Plausible(0.5, 100)] | None = None
    """Damping ratio from test to test; None: scatter of the series from 8 tests on, before that 10."""
    stiffness_percent: Annotated[Percent, Plausible(0.1, 50)] | None = None
    """Modal stiffness from test to test; None: scatter of the series from 8 tests on, before that 3."""
    speed_percent: Annotated[Percent, Plausible(0.02, 10)] = 1.0
    """Spindle speed."""
    coefficients_percent: Annotated[Percent, Plausible(1, 100)] = 20.0
    """Cutting coefficients and their ratio without a published range."""
    predicted_frequency_percent: Annotated[Percent, Plausible(0.1, 50)] = 3.0
    """Natural frequencies of a predicted tool."""
    predicted_damping_percent: Annotated[Percent, Plausible(1, 100)] = 30.0
    """Damping ratios of a predicted tool."""
    predicted_stiffness_percent: Annotated[Percent, Plausible(0.5, 100)] = 15.0
    """Modal stiffnesses of a predicted tool."""
    untapped_frequency_percent: Annotated[Percent, Plausible(0.1, 50)] = 5.0
    """Natural frequencies in an untapped direction, relative to the other one."""
    untapped_stiffness_percent: Annotated[Percent, Plausible(1, 100)] = 30.0
    """Modal stiffnesses in an untapped direction, relative to the other one."""
    wear: ToolWear = "new"
    """Allowed tool wear of programs without their own."""
