"""`lobewatch modes --beside`: a mode that other measurements also show is more trusted."""

from __future__ import annotations

import json
import shutil
from pathlib import Path

import numpy as np
import pytest

from modal import Mode, synthesize_frf
from tests.lobewatch.commands.test_modes import command

DATA = Path(__file__).parents[2] / "data"
PAIR = (1500.0, 1530.0)
"""Two modes so near to each other (Hz) that one FRF in noise shows one of them alone, which may be several."""


@pytest.fixture
def points(tmp_path: Path) -> list[Path]:
    """Accelerances of three points of one structure, each in noise of its own; the last has a mode of its own, too."""
    lines, files = np.arange(5.0, 4000.0, 5.0), []
    for place, (first, second) in enumerate([(3e7, 3e7), (2e7, 4e7), (-3e7, -5e7)]):
        modes = [Mode(PAIR[0], 0.03, first), Mode(PAIR[1], 0.03, second)]
        own = [Mode(2600.0, 0.02, 8e7)] if place == 2 else []
        exact = synthesize_frf([*modes, *own], lines).accelerance
        noise = np.random.default_rng(place).normal(size=(2, lines.size)) * 0.01 * np.max(np.abs(exact))
        noisy = exact + noise[0] + 1j * noise[1]
        files.append(tmp_path / f"point{place + 1}.csv")
        table = np.column_stack([lines, noisy.real, noisy.imag])
        np.savetxt(files[-1], table, delimiter=",", header="frequency [Hz],real [m/s^2/N],imag [m/s^2/N]", comments="")
    return files


def modes_of(capsys: pytest.CaptureFixture[str]) -> list[tuple[float, str, list[int] | None]]:
    """Frequency (Hz), trust and what was found again, of each mode printed."""
    modes = json.loads(capsys.readouterr().out)["modes"]
    return [(mode["frequency_hz"], mode["trust"], mode["found_again"]) for mode in modes]


def test_what_other_points_have_is_trusted_and_a_mode_of_one_point_is_not(
    points: list[Path], monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    first, second, third = map(str, points)
    assert command(monkeypatch, first, "--json") == 0
    alone = modes_of(capsys)
    assert [(trust, again) for _, trust, again in alone] == [("doubtful", None)]
    assert command(monkeypatch, first, "--beside", second, "--beside", third, "--json") == 0
    assert modes_of(capsys) == [(alone[0][0], "trusted", [2, 2])]
    assert command(monkeypatch, third, "--beside", first, "--beside", second, "--json") == 0
    assert [again for _, _, again in modes_of(capsys)] == [[2, 2], [0, 2]]


def test_the_table_says_in_how_many_others_and_what_the_column_is(
    points: list[Path], monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    first, second, third = map(str, points)
    assert command(monkeypatch, third, "--beside", first, "--beside", second) == 0
    shown = capsys.readouterr().out
    assert "2 of 2" in shown
    assert "0 of 2" in shown
    assert "0.5 %" in shown
    assert max(map(len, shown.splitlines()[1:4])) <= 80
    assert command(monkeypatch, third) == 0
    assert "again:" not in capsys.readouterr().out


def test_other_responses_of_one_measured_file_by_their_numbers(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    file = str(DATA / "vibrationtesting" / "mckiddat.mat")
    said = [file, "--unit", "m/N", "--response", "1"]
    assert command(monkeypatch, *said, "--beside", "2", "--beside", "3", "--json") == 0
    assert [(round(f, 3), again) for f, _, again in modes_of(capsys)] == [(f, [2, 2]) for f in (0.103, 0.196, 0.325)]


@pytest.mark.parametrize(
    ("beside", "complaint"),
    [
        (["2"], "--beside 2"),
        (["2", "2"], "--beside 2: "),
        (["1", "2"], "--beside 1: "),
        (["2", "4"], "--response 4"),
        (["2", "missing.csv"], "missing.csv: No such file"),
    ],
)
def test_what_is_no_other_measurement_is_rejected(
    beside: list[str], complaint: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    file = str(DATA / "vibrationtesting" / "mckiddat.mat")
    options = [word for other in beside for word in ("--beside", other)]
    assert command(monkeypatch, file, "--unit", "m/N", "--response", "1", *options) == 2
    assert complaint in capsys.readouterr().err


def test_a_copy_is_not_another_measurement(
    points: list[Path], monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    copy = shutil.copy(points[0], points[0].with_name("copy.csv"))
    assert command(monkeypatch, str(points[0]), "--beside", str(points[1]), "--beside", str(copy)) == 2
    assert "copy.csv: " in capsys.readouterr().err
