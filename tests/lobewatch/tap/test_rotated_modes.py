"""Emulated spindle with rotated principal directions, tapped in x, y and xy through the bytes of a device."""

from __future__ import annotations

import sys
from datetime import timedelta

import numpy as np
import pytest

from acquisition import Circumstances, Structure, TapDirection
from lobes import project_modes
from lobewatch.cli import main
from lobewatch.tap.emulated_spindle import (
    SECOND_AXIS_FREQUENCY_SHIFT,
    build_structure,
    open_synchronized_device,
    rotate_structure,
)
from lobewatch.tap.session import TapSession
from modal import Mode
from tests.lobewatch.conftest import Shop

ANGLE = 35.0
DIRECTIONS: tuple[TapDirection, ...] = ("x", "y", "xy")


def flexibility(structure: Structure, frequency: float) -> complex:
    ratio = frequency / structure.frequency
    modes = 1 / (structure.stiffness * (1 - ratio**2 + 2j * structure.damping_ratio * ratio))
    return complex(np.sum(modes) + structure.residual)


def test_the_structure_shows_what_its_mode_vectors_show() -> None:
    round_one = Structure(np.array([1500.0]), np.array([0.03]), np.array([20e6]))
    c, s = np.cos(np.radians(ANGLE)), np.sin(np.radians(ANGLE))
    pair = [
        Mode(1500.0, 0.03, 20e6),
        Mode(1500.0 * (1 + SECOND_AXIS_FREQUENCY_SHIFT), 0.03, 20e6 * (1 + SECOND_AXIS_FREQUENCY_SHIFT) ** 2),
    ]
    shown = project_modes(pair, np.array([[c, s], [-s, c]]))
    for direction, modes in zip(DIRECTIONS, (shown.x, shown.y, shown.cross), strict=True):
        structure = rotate_structure(round_one, ANGLE, direction)
        for frequency in (300.0, 1480.0, 1560.0, 2500.0):
            wanted = sum(mode.receptance(np.array([frequency]))[0] for mode in modes)
            assert flexibility(structure, frequency) == pytest.approx(wanted, rel=1e-9)


def test_along_the_axes_each_direction_shows_its_own_mode_and_nothing_across() -> None:
    round_one = Structure(np.array([1500.0]), np.array([0.03]), np.array([20e6]), 1e-9)
    assert rotate_structure(round_one, 0, "x").frequency.tolist() == [1500.0]
    assert rotate_structure(round_one, 0, "y").frequency == pytest.approx([1575.0])
    assert rotate_structure(round_one, 90, "x").frequency == pytest.approx([1575.0])
    with pytest.raises(ValueError, match=r"rotate_structure\.direction xy"):
        rotate_structure(round_one, 0, "xy")
    with pytest.raises(ValueError, match=r"95.*90"):
        rotate_structure(round_one, 95, "x")


def test_the_command_says_what_shows_nothing_and_what_is_no_cut(
    shop: Shop, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    for words, reason in [
        (["--direction", "xy"], "--direction xy"),
        (["--askew", "-3"], "--askew -3"),
        (["--askew", "20", "--cut", "A"], "--cut"),
    ]:
        monkeypatch.setattr(sys, "argv", ["lobewatch", "emulate", "taps", str(shop.path), *words])
        with pytest.raises(SystemExit) as end:
            main()
        assert end.value.code == 2
        assert reason in capsys.readouterr().err


def test_three_taps_through_a_device_decide_to_which_side_the_modes_lie(shop: Shop) -> None:
    shop.edit("hits = 10 ", "hits = 4 ")
    table = shop.folder.machine.spindle
    assert table is not None
    spindle = build_structure(table.build(), table.damping_ratio)
    for days, direction in enumerate(DIRECTIONS):
        about = Circumstances(
            "m", shop.start + timedelta(hours=days), "reference", direction, "", shop.folder.toml_text
        )
        with open_synchronized_device(
            rotate_structure(spindle, ANGLE, direction), np.random.default_rng(days)
        ) as source:
            TapSession(shop.folder, source, about, guided=False).run()
        if direction == "y":
            assert len(shop.logbook.assembly("reference").principal_directions.sign_patterns) == 2
    tool = shop.logbook.assembly("reference")
    assert tool.cross is not None
    (vectors,) = tool.principal_directions.sign_patterns
    assert vectors is not None
    first = int(np.argmin([mode.frequency for mode in tool.x or ()]))
    assert vectors[first] == pytest.approx([np.cos(np.radians(ANGLE)), np.sin(np.radians(ANGLE))], abs=0.02)
