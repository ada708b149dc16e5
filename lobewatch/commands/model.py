"""lobewatch model."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import numpy as np
import typer
from rich.table import Table

from dsm import (
    Spindle,
    energy_shares,
    modes_at,
    natural_frequencies,
    static_stiffness,
)
from lobewatch.analysis import Logbook, first_critical_speed, model_picture, model_state
from lobewatch.show.figures import save_figure
from lobewatch.show.figures_model import model_figure
from lobewatch.show.output import Json, emit, table


def model(
    machine: Annotated[Path, typer.Argument(help=r"Machine folder with a \[spindle] in its machine.toml.")],
    tool: Annotated[str | None, typer.Option(help=r"Name of a \[\[tool]]; else the one that is tapped.")] = None,
    modes: Annotated[int, typer.Option(min=1, max=20, help="How many modes.")] = 4,
    figure: Annotated[Path | None, typer.Option(help="Draw the model to this file (.svg, .png, .pdf).")] = None,
    as_json: Json = False,
) -> None:
    """The spindle model: modes, stiffness, critical speed; with another tool in it, predicted before it is tapped.

    The bearings are those of the newest tap test, of machine.toml where there is none yet.

    Examples:

      lobewatch model trial --figure model.png

      lobewatch model trial --tool "end mill 16" --modes 6 --json
    """
    logbook = Logbook.open(machine)
    state = model_state(logbook.machine, logbook.calibrated, tool)
    found = _modes(state.spindle, modes)
    critical = first_critical_speed(state.spindle)
    static = static_stiffness(state.spindle)
    rigid = float(natural_frequencies(state.spindle, 1, rigid_bearings=True)[0])
    if figure is not None:
        save_figure(model_figure(model_picture(logbook, state, modes)), figure)
    payload: dict[str, Any] = {
        "tool": state.tool,
        "bearings_from": state.origin,
        "theory": state.spindle.theory,
        "length_mm": state.spindle.length * 1e3,
        "mass_kg": state.spindle.mass,
        "modes": found,
        "static_tip_stiffness_n_per_m": static,
        "critical_speed_rpm": critical,
        "first_frequency_with_rigid_bearings_hz": rigid,
    }
    emit(
        payload,
        as_json,
        f"{state.title}: {state.spindle.theory}, {payload['length_mm']:.1f} mm, {payload['mass_kg']:.2f} kg",
        f"bearings of {state.origin}",
        _table(found),
        f"static stiffness at the tip  {static / 1e6:.3f} N/um",
        f"critical speed               {'none' if critical is None else f'{critical:.0f} rpm'}",
        f"with rigid bearings          {rigid:.1f} Hz in mode 1",
    )


def _modes(spindle: Spindle, count: int) -> list[dict[str, Any]]:
    frequency, stiffness = modes_at(spindle, count)
    shares = energy_shares(spindle, count)
    return [
        {
            "frequency_hz": frequency[n],
            "modal_tip_stiffness_n_per_m": stiffness[n],
            "bearing_energy_share": float(np.sum(shares.bearings[n] + shares.housings[n])),
            "segment_energy_share": float(np.sum(shares.segments[n])),
            "joint_energy_share": float(np.sum(shares.joints[n])),
        }
        for n in range(count)
    ]


def _table(modes: list[dict[str, Any]]) -> Table:
    made = table("mode", "f (Hz)", "K at the tip (N/um)", "energy in bearings (%)", "shaft (%)", "joints (%)")
    for number, mode in enumerate(modes, 1):
        made.add_row(
            str(number),
            f"{mode['frequency_hz']:.2f}",
            f"{mode['modal_tip_stiffness_n_per_m'] / 1e6:.4g}",
            *(f"{100 * mode[f'{part}_energy_share']:.1f}" for part in ("bearing", "segment", "joint")),
        )
    return made
