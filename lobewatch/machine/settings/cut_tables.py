"""Tables of machine.toml about cutting: the reference cut, programs, materials and the drive."""

from __future__ import annotations

import math
from typing import Annotated

from msgspec import Meta

from lobes import Coefficients, Direction, tangential_and_radial
from lobewatch.machine.settings.toml_table import NotNegative, Positive, PositiveOrInfinite, Table

FEED_ANGLES = {"x": 0.0, "y": math.pi / 2}
"""Angles from x to the feed (rad), by axis of the machine."""
BETWEEN = 0.5
"""Radial depth over diameter below which a cut in both directions is worst at angles between x and y."""


class CutTable(Table, frozen=True):
    """[reference_cut], and what it shares with a program."""

    teeth: Annotated[int, Meta(ge=1)]
    radial_depth_mm: Positive
    tool_diameter_mm: Positive
    direction: Direction
    material: str | None = None
    tangential_n_per_mm2: Positive | None = None
    radial_n_per_mm2: NotNegative | None = None
    helix_deg: Annotated[float, Meta(ge=0, lt=90)] = 0.0
    feed_per_tooth_mm: Positive | None = None
    flute_length_mm: Positive | None = None

    @property
    def feeds(self) -> tuple[str, ...]:
        """Axes of the machine that it is fed along."""
        return tuple(FEED_ANGLES)

    @property
    def deepest_mm(self) -> float:
        """Greatest depth of cut of the tool (mm); where the length of its flutes is not known, one diameter."""
        return self.tool_diameter_mm if self.flute_length_mm is None else self.flute_length_mm

    def __post_init__(self) -> None:
        """Refuse a cut wider than the tool, and coefficients that are missing or stand twice."""
        if self.radial_depth_mm > self.tool_diameter_mm:
            raise ValueError(
                f"radial_depth_mm={self.radial_depth_mm:g} is larger than tool_diameter_mm={self.tool_diameter_mm:g}"
            )

        given = {self.tangential_n_per_mm2 is None, self.radial_n_per_mm2 is None}
        if given != {self.material is not None}:
            raise ValueError("give either material or both tangential_n_per_mm2 and radial_n_per_mm2")


class ProgramTable(CutTable, frozen=True, kw_only=True):
    """[[program]]: one cut that the shop runs."""

    name: Annotated[str, Meta(min_length=1)]
    tool: str = "reference"
    speed_rpm: Positive
    depth_mm: Positive
    feed: str = "both"

    def __post_init__(self) -> None:
        """Refuse a feed that is none, and a cut deeper than the flutes."""
        super().__post_init__()
        if self.feed not in (*FEED_ANGLES, "both"):
            raise ValueError(f'feed={self.feed!r} is no direction; give "x", "y" or "both"')
        if self.flute_length_mm is not None and self.depth_mm > self.flute_length_mm:
            raise ValueError(f"depth_mm={self.depth_mm:g} is deeper than flute_length_mm={self.flute_length_mm:g}")

    @property
    def deepest_mm(self) -> float:
        """Greatest depth of cut of the tool (mm); without a known length of flutes one diameter or what it cuts now."""
        return max(super().deepest_mm, self.depth_mm)

    @property
    def feeds(self) -> tuple[str, ...]:
        """Axes of the machine that it is fed along."""
        return super().feeds if self.feed == "both" else (self.feed,)

    @property
    def feed_angles(self) -> tuple[float, ...]:
        """Directions of feed in which it is judged, as angles from x (rad): half a turn apart they are alike."""
        if self.feed != "both":
            return (FEED_ANGLES[self.feed],)
        number = 2 if self.radial_depth_mm / self.tool_diameter_mm >= BETWEEN else 12
        return tuple(i * math.pi / number for i in range(number))


class MaterialTable(Table, frozen=True):
    """[[material]]: cutting coefficients of one's own, Ktc and Krc or Ks and beta, with edge coefficients if known."""

    name: Annotated[str, Meta(min_length=1)]
    tangential_n_per_mm2: Positive | None = None
    radial_n_per_mm2: NotNegative | None = None
    specific_force_n_per_mm2: Positive | None = None
    force_angle_deg: Annotated[float, Meta(gt=0, le=90)] | None = None
    tangential_edge_n_per_mm: NotNegative = math.nan
    radial_edge_n_per_mm: NotNegative = math.nan
    source: str = "machine.toml"

    def __post_init__(self) -> None:
        """Refuse a material without one whole pair of coefficients."""
        pairs = (
            (self.tangential_n_per_mm2, self.radial_n_per_mm2),
            (self.specific_force_n_per_mm2, self.force_angle_deg),
        )
        if sorted(sum(value is not None for value in pair) for pair in pairs) != [0, 2]:
            raise ValueError(
                "give either tangential_n_per_mm2 and radial_n_per_mm2, or specific_force_n_per_mm2 and force_angle_deg"
            )

    def build(self) -> Coefficients:
        """The coefficients in SI units."""
        tangential, radial = self.tangential_n_per_mm2, self.radial_n_per_mm2
        if self.specific_force_n_per_mm2 is not None and self.force_angle_deg is not None:
            tangential, radial = tangential_and_radial(
                self.specific_force_n_per_mm2, math.radians(self.force_angle_deg)
            )
        return Coefficients(
            self.name,
            (tangential or 0.0) * 1e6,
            (radial or 0.0) * 1e6,
            self.tangential_edge_n_per_mm * 1e3,
            self.radial_edge_n_per_mm * 1e3,
            source=self.source,
        )


class Drive(Table, frozen=True):
    """[drive]: power and torque of the spindle motor; optional."""

    power_kw: PositiveOrInfinite = math.inf
    torque_nm: PositiveOrInfinite = math.inf
