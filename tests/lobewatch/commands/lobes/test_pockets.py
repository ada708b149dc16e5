"""Safe pockets as `lobewatch lobes` names them."""

from __future__ import annotations

import json
from collections.abc import Sequence
from itertools import pairwise
from typing import Any

import numpy as np
import pytest

from lobes import zero_order_lobes
from lobewatch.logbook import Logbook, compare_lobes
from lobewatch.machine import drive_depth_limit
from lobewatch.machine.folder import MachineFolder
from lobewatch.show.figures.drawing import render_svg
from lobewatch.show.figures.lobe_figures import BAND_LABEL, plot_comparison
from lobewatch.show.programs.advice import comparison_json, comparison_texts
from lobewatch.tool import DynamicsSource, LobeMethod, compute_lobes
from lobewatch.verdicts import Stability
from lobewatch.verdicts.recommendation import find_stable_pockets
from modal import Mode
from tests.lobewatch.commands.conftest import Run
from tests.lobewatch.commands.lobes.conftest import MODEL, edit, tap


def with_pockets(folder: MachineFolder, found: Sequence[dict[str, Any]]) -> MachineFolder:
    """Each pocket of the reference cut as a program, and no other program."""
    text = folder.toml.read_text("utf-8")
    head, _, rest = text.partition("[[program]]")
    cut = head.partition("[reference_cut]\n")[2]
    tail = rest[rest.index(MODEL) :]
    programs = "".join(
        f'[[program]]\nname = "{i}"\nspeed_rpm = {one["speed_rpm"]}\ndepth_mm = {one["depth_mm"]}\n{cut}\n'
        for i, one in enumerate(found)
    )
    folder.toml.write_text(f"{head}{programs}\n{tail}", "utf-8")
    return MachineFolder(folder.path)


def test_a_pocket_entered_as_a_program_is_stable(run: Run, folder: MachineFolder) -> None:
    edit(folder, "radial_depth_mm = 20            #", "radial_depth_mm = 12\nflute_length_mm = 9  #")
    tap(folder, 1541.7)
    tap(folder, 1560.0, days=0.2, direction="y")
    found = json.loads(run("lobes", "m", "--json").out)["pockets"]
    assert len(found) == 3
    for one, less in pairwise(found):
        assert one["speed_rpm"] * one["depth_mm"] > less["speed_rpm"] * less["depth_mm"]
    for one in found:
        assert one["depth_mm"] <= 9.0
        assert one["speed_rpm"] % 10 == 0
        assert one["depth_mm"] / 0.05 == pytest.approx(round(one["depth_mm"] / 0.05))
        assert one["frequency_left"] >= 0.02
        low, high = one["window_rpm"]
        robust = (low, 0.98 * high)
        step = 0.005 * high + 10  # of the window, whose ends and whose setting are rounded to 10 rpm
        assert one["speed_rpm"] == pytest.approx(np.mean(robust), abs=0.5 * np.ptp(robust) + step)
        assert low <= one["speed_rpm"] <= high
    verdicts = Logbook(with_pockets(folder, found)).verdicts()
    assert [verdict.stability for verdict in verdicts] == [Stability.STABLE] * 3
    for verdict, one in zip(verdicts, found, strict=True):
        assert verdict.depth_margin >= 0.2
        assert verdict.depth_margin == pytest.approx(one["depth_margin"])
    ends = [one | {"speed_rpm": speed} for one in found for speed in one["window_rpm"]]
    assert {verdict.stability for verdict in Logbook(with_pockets(folder, ends)).verdicts()} == {Stability.STABLE}


def test_pockets_stay_within_flutes_and_drive(folder: MachineFolder) -> None:
    edit(
        folder, "radial_n_per_mm2 = 500\n\n", "radial_n_per_mm2 = 500\nflute_length_mm = 2\nfeed_per_tooth_mm = 0.1\n\n"
    )
    folder = edit(folder, "[speed]", "[drive]\npower_kw = 6\n\n[speed]")
    tap(folder, 1541.7)
    tap(folder, 1560.0, days=0.2, direction="y")
    cut, assembly = folder.machine.reference_cut, Logbook(folder).assembly()
    assert cut is not None
    found = find_stable_pockets(cut, assembly, folder.machine)
    allowed = [drive_depth_limit(folder.machine, cut, np.array([one.speed_rpm]))[0] * 1e3 for one in found]
    assert len(found) >= 2
    assert max(one.depth_mm for one in found) <= 2.0
    assert all(one.depth_mm <= limit for one, limit in zip(found, allowed, strict=True))
    assert min(allowed) < 2.0 < max(allowed)


def test_pockets_are_printed_and_drawn_as_they_are(folder: MachineFolder) -> None:
    tap(folder, 1541.7)
    tap(folder, 1560.0, days=0.2, direction="y")
    found = compare_lobes(Logbook(folder), None, "reference cut", DynamicsSource.MODES, LobeMethod.ZERO_ORDER)
    said, texts = comparison_json(found, []), comparison_texts(found, [])
    table, *_ = (text for text in texts if not isinstance(text, str))
    printed = list(zip(*(column.cells for column in table.columns), strict=True))
    drawn = render_svg(plot_comparison(folder.machine, found, ()))
    assert len(found.pockets) == len(printed) == 3
    for one, cells in zip(said["pockets"], printed, strict=True):
        low, high = one["window_rpm"]
        assert cells[:3] == (f"{one['speed_rpm']:.0f}", f"{low:.0f}..{high:.0f}", f"{one['depth_mm']:.2f}")
        assert 0 <= 100 * one["depth_margin"] - float(str(cells[3]).rstrip(" %")) < 1
        assert f"{one['speed_rpm']:.0f} rpm</text>" in drawn
        assert f"{one['depth_mm']:.2f} mm</text>" in drawn
    assert BAND_LABEL in drawn


def test_nothing_is_called_safe_with_one_direction(run: Run, folder: MachineFolder) -> None:
    tap(folder, 1713.0)
    said = json.loads(run("lobes", "m", "--json").out)
    (why,) = (remark for remark in said["remarks"] if remark["code"] == "no-safe-pocket")
    assert said["pockets"] == []
    assert all(fact in why["cure"] for fact in ("direction y", "'reference'"))
    assert "one-direction" in [remark["code"] for remark in said["remarks"]]
    assert "direction y" in run("lobes", "m").out


def test_a_direction_that_was_not_tapped_is_not_rigid(run: Run, folder: MachineFolder) -> None:
    tap(folder, 1713.0)
    both, frf = (json.loads(run("lobes", "m", "--source", name, "--json").out) for name in ("modes", "frf"))
    modes, cut = [Mode(1713.0, 0.029136, 3.5e7)], folder.machine.build_cut(folder.machine.program[0])
    alike = zero_order_lobes(modes, modes, cut, both["speed_rpm"]).minimum.depth * 1e3
    assert both["minimum_depth_mm"] == pytest.approx(alike, rel=1e-3)
    assert frf["minimum_depth_mm"] == pytest.approx(alike, rel=0.01)
    assert "one-direction" in [remark["code"] for remark in frf["remarks"]]


def test_no_safe_speed_is_reported(run: Run, folder: MachineFolder) -> None:
    edit(folder, "tangential_n_per_mm2 = 1400\n", "tangential_n_per_mm2 = 140000\n")
    tap(folder, 1541.7)
    tap(folder, 1560.0, days=0.2, direction="y")
    said = run("lobes", "m").out
    assert said.count("3000..24000 rpm") == 1


def test_pockets_are_compared_where_both_tops_are_known(run: Run, folder: MachineFolder) -> None:
    tap(folder, 1713.0)
    tap(folder, 1700.0, days=300, stiffness=1.2e7)
    said = json.loads(run("lobes", "m", "--json").out)
    logbook = Logbook(folder)
    first = compute_lobes(logbook.assembly(until=logbook.taps[0].id), folder.machine)["reference cut"]
    shifts = said["pocket_shifts"]
    assert len(shifts) >= 3
    for shift in shifts:
        top = float(first.depth_at(shift["then"]["speed_rpm"]))
        assert shift["then"]["depth_mm"] == pytest.approx(top * 1e3)
        assert shift["depth_change"] == pytest.approx(1.2 / 3.5 - 1, abs=0.05)
