"""lobewatch demo."""

from __future__ import annotations

import itertools
from collections.abc import Iterator
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import typer
from rich.progress import Progress
from rich.table import Table

from acquisition import Circumstances, TapsSource
from dsm import Spindle, calibrate, natural_frequencies
from lobewatch.analysis import Logbook, Measurement
from lobewatch.machine.folder import MachineFolder
from lobewatch.machine.new_folder import make_machine_folder
from lobewatch.show.output import Json, emit, notes, table
from lobewatch.show.report import write_report
from lobewatch.tap.emulated_spindle import emulated_structure, emulator, with_bearing_stiffness
from lobewatch.tap.session import TapSession

FALL = 0.10
"""Fall of the first natural frequency over the demo."""
FIELDS = ("frequency_hz", "damping_ratio", "stiffness_n_per_m", "bearing_stiffness_n_per_m")


@dataclass(frozen=True)
class Month:
    """One tap test of the demo: what was emulated and what was found."""

    date: datetime
    """Of the simulated calendar."""
    truth: dict[str, float]
    """By name of FIELDS."""
    found: dict[str, float]
    """By name of FIELDS."""

    def error(self, field: str) -> float:
        """Relative error of one field (-)."""
        return self.found[field] / self.truth[field] - 1


def demo(
    out: Annotated[Path | None, typer.Option(help="A new folder; lobewatch-demo where not given.")] = None,
    taps: Annotated[int, typer.Option(min=2, max=120, help="How many monthly tap tests.")] = 24,
    seed: Annotated[int, typer.Option(help="Of the random numbers.")] = 1,
    as_json: Json = False,
) -> None:
    """A simulated spindle ages over 24 monthly tap tests; ends with its report.

    Every test goes through a real serial port (a pseudo-terminal), byte by byte: ten good hits, FRF, HDF5, modes,
    bearing stiffness, stability lobes, history. What was emulated is printed beside what was found.

    Examples:

      lobewatch demo

      lobewatch demo --out trial --taps 6
    """
    path = out or next(p for p in _names() if not p.exists())
    make_machine_folder(path, "surrogate_machine.toml")
    folder = MachineFolder(path)
    randoms = np.random.default_rng(seed).spawn(taps)
    wear = zip(_dates(), _wear(folder, taps), randoms, strict=False)
    months = []
    with Progress(console=notes, transient=True, disable=not notes.is_terminal) as progress:
        for date, spindle, random in progress.track(wear, total=taps, description="tap tests"):
            months.append(_tap(folder, date, spindle, random))
    report = write_report(Logbook(folder))
    fall = [months[-1].found["stiffness_n_per_m"] / months[0].found["stiffness_n_per_m"] - 1]
    fall.append(months[-1].truth["stiffness_n_per_m"] / months[0].truth["stiffness_n_per_m"] - 1)
    emit(
        _payload(months, report),
        as_json,
        "Emulated, and found beside it (f_1 natural frequency, zeta damping ratio, K stiffness at the tool tip,",
        "k_b stiffness of each bearing):",
        _truth_table(months),
        "worst error: " + ", ".join(_worst(months)),
        f"K over the whole demo: {100 * fall[0]:+.2f} % found, {100 * fall[1]:+.2f} % true",
        f"report: {report}",
    )


def _names() -> Iterator[Path]:
    yield Path("lobewatch-demo")
    yield from (Path(f"lobewatch-demo-{i}") for i in itertools.count(2))


def _dates() -> Iterator[datetime]:
    for month in itertools.count():
        yield datetime(2024 + month // 12, month % 12 + 1, 15, 9, tzinfo=UTC)


def _wear(folder: MachineFolder, taps: int) -> list[Spindle]:
    """Bearings that lose the same share of their stiffness every month, until f_1 has fallen by FALL."""
    table_ = folder.machine.spindle
    if table_ is None:
        raise ValueError(f"{folder.toml}: no [spindle]")
    new = table_.build()
    fresh = table_.bearing_stiffness_n_per_um * 1e6
    worn = calibrate(new, (1 - FALL) * float(natural_frequencies(new, 1)[0])).bearing_stiffness
    return [with_bearing_stiffness(new, k) for k in np.geomspace(fresh, worn, taps)]


def _tap(folder: MachineFolder, date: datetime, spindle: Spindle, random: np.random.Generator) -> Month:
    machine = folder.machine
    damping = machine.spindle.damping_ratio if machine.spindle else 0.0
    structure = emulated_structure(spindle, damping)
    about = Circumstances(machine.machine.name, date, machine.tap.tool, "x", "the demo", folder.toml.read_text("utf-8"))
    with emulator(structure, random, realtime=False) as device:
        session = TapSession(folder, lambda: TapsSource(device.port), about, resume=False, guided=False)
        session.run()
    truth = (structure.frequency[0], damping, structure.stiffness[0], spindle.bearings[0].stiffness)
    return Month(date, dict(zip(FIELDS, map(float, truth), strict=True)), _found(session.measurement))


def _found(measurement: Measurement) -> dict[str, float]:
    mode, calibration = measurement.followed, measurement.calibration
    if mode is None or calibration is None:
        raise ValueError(f"tap {measurement.tap_id}: {'; '.join(map(str, measurement.remarks))}")
    found = (mode.frequency, mode.damping_ratio, mode.stiffness, calibration.bearing_stiffness)
    return dict(zip(FIELDS, found, strict=True))


def _truth_table(months: list[Month]) -> Table:
    headings = ("f_1 Hz", "zeta %", "K N/um", "k_b N/um")
    made = table("<month", *(word for heading in headings for word in (heading, "found")))
    for month in months:
        cells = []
        for field, scale, digits in zip(FIELDS, (1.0, 0.01, 1e6, 1e6), (2, 3, 3, 1), strict=True):
            cells += [f"{values[field] / scale:.{digits}f}" for values in (month.truth, month.found)]
        made.add_row(f"{month.date:%Y-%m}", *cells)
    return made


def _worst(months: list[Month]) -> list[str]:
    names = ("f_1", "zeta", "K", "bearing stiffness")
    worst = [max(abs(month.error(field)) for month in months) for field in FIELDS]
    return [f"{name} {100 * error:.2g} %" for name, error in zip(names, worst, strict=True)]


def _payload(months: list[Month], report: Path) -> dict[str, Any]:
    taps = [{"date": month.date.isoformat(), "truth": month.truth, "found": month.found} for month in months]
    return {"taps": taps, "report": str(report)}
