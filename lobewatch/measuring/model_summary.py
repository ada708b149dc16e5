"""A model in figures: its first modes, stiffness and critical speed."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from dsm import energy_shares, modes_at, natural_frequencies, static_stiffness
from lobewatch.measuring.model_state import ModelState, first_critical_speed


@dataclass(frozen=True)
class ModelMode:
    """One mode of the model."""

    frequency: float
    """Natural frequency (Hz)."""
    tip_stiffness: float
    """Modal stiffness at the tool tip (N/m)."""
    bearing_share: float
    """Share of its strain energy in bearings and housings (-)."""
    segment_share: float
    """Share of its strain energy in the shaft (-)."""
    joint_share: float
    """Share of its strain energy in the joints (-)."""


@dataclass(frozen=True)
class ModelSummary:
    """The model in figures."""

    state: ModelState
    """Model with its tool."""
    modes: tuple[ModelMode, ...]
    """First modes, the lowest first."""
    static_stiffness: float
    """Static stiffness at the tool tip (N/m)."""
    critical_speed: float | None
    """Lowest critical speed (rpm); None where gyroscopic moments leave none."""
    rigid_frequency: float
    """Natural frequency of the first mode with rigid bearings (Hz): no bearing lifts it beyond."""


def model_summary(state: ModelState, count: int) -> ModelSummary:
    """Its first modes, stiffness and critical speed."""
    frequency, stiffness = modes_at(state.spindle, count)
    shares = energy_shares(state.spindle, count)
    modes = tuple(
        ModelMode(
            frequency=float(frequency[n]),
            tip_stiffness=float(stiffness[n]),
            bearing_share=float(np.sum(shares.bearings[n] + shares.housings[n])),
            segment_share=float(np.sum(shares.segments[n])),
            joint_share=float(np.sum(shares.joints[n])),
        )
        for n in range(count)
    )
    return ModelSummary(
        state,
        modes,
        static_stiffness(state.spindle),
        first_critical_speed(state.spindle),
        float(natural_frequencies(state.spindle, 1, rigid_bearings=True)[0]),
    )
