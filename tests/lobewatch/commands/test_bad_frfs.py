"""FRFs that are cut, mirrored, of another quantity or late, at the command line."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from acquisition import DataError
from lobewatch.logbook import Logbook
from lobewatch.verdicts.verdict import Stability
from modal import Mode, synthesize_frf
from tests.lobewatch.commands.invoke import invoke

SPINDLE = [Mode(900.0, 0.03, 4e7), Mode(1500.0, 0.02, 3e7), Mode(2600.0, 0.015, 9e7)]
LINES = np.arange(2.0, 4000.0, 2.0)
RECEPTANCE = synthesize_frf(SPINDLE, LINES).receptance
RATE = 2j * np.pi * LINES
"""Factor of a time derivative (1/s)."""
ZEROS = np.zeros(LINES.size)


def run(*arguments: object) -> Any:
    return invoke([*map(str, arguments)])


def table(file: Path, values: NDArray[np.complex128], unit: str = "m/N", coherence: Any = None) -> Path:
    noise = np.random.default_rng(3).normal(size=(2, values.size))
    values = values * (1 + 0.005 * (noise[0] + 1j * noise[1]))
    columns = [LINES[: values.size], values.real, values.imag, *([] if coherence is None else [coherence])]
    header = f"frequency [Hz],real [{unit}],imag [{unit}]" + ("" if coherence is None else ",coherence")
    np.savetxt(file, np.column_stack(columns), delimiter=",", header=header, comments="")
    return file


@pytest.fixture
def machine(tmp_path: Path) -> Path:
    run("init", tmp_path / "mill", "--example")
    return tmp_path / "mill"


BAD = {
    "two-lines": (RECEPTANCE[:2], None),
    "nan": (np.full(LINES.size, np.nan + 0j), None),
    "infinite": (np.full(LINES.size, np.inf + 0j), None),
    "zero": (ZEROS + 0j, None),
    "no-coherence": (RECEPTANCE, ZEROS),
}


@pytest.mark.filterwarnings("ignore::RuntimeWarning")
@pytest.mark.parametrize("name", BAD)
def test_an_frf_without_a_measurement_is_rejected_and_not_stored(machine: Path, tmp_path: Path, name: str) -> None:
    file = table(tmp_path / f"{name}.csv", BAD[name][0], coherence=BAD[name][1])
    with pytest.raises(DataError, match=name):
        run("modes", file)
    with pytest.raises(ValueError, match=name):
        run("replay", machine, file, "--date", "2026-01-02")
    assert [*machine.glob("taps/*"), *machine.glob("journal*")] == []


WRONG = {
    "accelerance": (RATE**2 * RECEPTANCE, "m/N"),
    "mobility": (RATE * RECEPTANCE, "m/s^2/N"),
    "receptance": (RECEPTANCE, "m/s/N"),
}


@pytest.mark.parametrize("true", WRONG)
def test_a_wrong_quantity_is_a_question_and_nothing_is_stable(machine: Path, tmp_path: Path, true: str) -> None:
    file = table(tmp_path / "frf.csv", *WRONG[true])
    printed = json.loads(run("modes", file, "--json").stdout)
    remarks = [remark for mode in printed["modes"] for remark in mode["remarks"]]
    assert {remark["code"] for remark in remarks} == {"wrong-quantity"}
    assert {mode["trust"] for mode in printed["modes"]} == {"doubtful"}
    assert not {"sign-swapped", "channel-delay"} & {remark["code"] for remark in printed["remarks"]}
    for day, direction in enumerate("xy", 2):
        run("replay", machine, file, "--date", f"2026-01-0{day}", "--direction", direction, "--keep-going")
    logbook = Logbook.open(machine)
    asked = {remark.code for row in logbook.history.rows for remark in row.questions}
    assert "wrong-quantity" in asked
    assert Stability.STABLE not in {verdict.stability for verdict in logbook.verdicts()}


def test_new_columns_answer_the_question(tmp_path: Path) -> None:
    file = table(tmp_path / "frf.csv", *WRONG["accelerance"])
    columns = "frequency [Hz],real [m/s^2/N],imag [m/s^2/N]"
    modes = json.loads(run("modes", file, "--columns", columns, "--json").stdout)["modes"]
    assert [mode["stiffness_n_per_m"] for mode in modes] == pytest.approx([m.stiffness for m in SPINDLE], rel=0.02)
    assert {mode["trust"] for mode in modes} == {"trusted"}


def test_a_late_response_is_said_and_k_keeps_its_sign(machine: Path, tmp_path: Path) -> None:
    file = table(tmp_path / "frf.csv", RECEPTANCE * np.exp(-RATE * 1e-3))
    printed = json.loads(run("modes", file, "--json").stdout)
    assert "response-delay-removed" in [remark["code"] for remark in printed["remarks"]]
    assert [m["stiffness_n_per_m"] for m in printed["modes"]] == pytest.approx([m.stiffness for m in SPINDLE], rel=0.02)
    run("replay", machine, file, "--date", "2026-01-02")
    measured = Logbook.open(machine).measurement(Logbook.open(machine).newest_tap().id)
    assert "response-delay-removed" in [remark.code for remark in measured.remarks]
    assert all(mode.is_driving_point for mode in measured.modes)


def test_new_columns_replace_the_quantity_of_a_universal_file(tmp_path: Path) -> None:
    file, universal = table(tmp_path / "frf.csv", *WRONG["accelerance"]), tmp_path / "frf.uff"
    run("convert", file, universal)
    columns = "frequency [Hz]=frequency,frf [m/s^2/N]=1 over 1"
    modes = json.loads(run("modes", universal, "--columns", columns, "--json").stdout)["modes"]
    assert [mode["stiffness_n_per_m"] for mode in modes] == pytest.approx([m.stiffness for m in SPINDLE], rel=0.02)
