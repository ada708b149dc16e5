"""Hits that a person accepts or rejects: of a file, of a replayed file, and of a stored tap test."""

from __future__ import annotations

import hashlib
import json
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from typer.testing import CliRunner, Result

from acquisition import (
    Circumstances,
    Description,
    Hit,
    HitDecision,
    HitFlags,
    Structure,
    TapTest,
    check_hit,
    estimate_frf,
    new_tap_id,
    read_frf,
    read_hits,
    read_tap,
    write_tap,
)
from lobewatch.cli import app
from lobewatch.logbook.rebuild_history import TapFileBytes, fit_tap_bytes
from lobewatch.machine import MachineFolder
from lobewatch.measurement import fit_file_modes
from lobewatch.measurement.hit_choice import format_unused_hits
from modal import Mode, synthesize_frf

Shop = Any
"""Machine fixture of tests/lobewatch/conftest.py."""
RATE, N, BEFORE = 25600, 6400, 400
STRUCTURE = Structure(np.array([1713.0]), np.array([0.03]), np.array([3.5e7]))
CLIPPED, SILENT, WIDER = 3, 5, 2
"""Numbers of the hit with a clipped force, the one without response, and one with another gain of the response."""
DATED = "--date", "2026-03-02"


@pytest.fixture
def shop(shop: Shop) -> Shop:
    """Without programs, which take their time."""
    shop.put("")
    return shop


@pytest.fixture
def file(tmp_path: Path) -> Path:
    """Write a long record with six hits, four of them good."""
    random, parts = np.random.default_rng(5), []
    time = np.arange(-BEFORE, N - BEFORE) / RATE
    for number in range(1, 7):
        peak = random.uniform(150, 350)
        force = peak * np.where((time >= 0) & (time <= 4e-4), np.sin(np.pi * time / 4e-4) ** 2, 0.0)
        response = (number != SILENT) * (1.1 if number == WIDER else 1.0) * peak * STRUCTURE.response(time, 4e-4)
        force = force + 0.05 * random.normal(size=N)
        force = np.minimum(force, 0.7 * peak) if number == CLIPPED else force
        parts.append([force, response + 0.5 * random.normal(size=N)])
    force, response = np.concatenate(parts, axis=1)
    table = np.column_stack([np.arange(force.size) / RATE, force, response])
    path, header = tmp_path / "hits.csv", "time [s],force [N],acceleration [m/s^2]"
    np.savetxt(path, table, delimiter=",", fmt="%.9g", header=header, comments="")
    return path


def run(*arguments: object) -> Result:
    return CliRunner().invoke(app, [*map(str, arguments)])


def journal(shop: Shop) -> list[dict[str, Any]]:
    path = shop.path / "journal.jsonl"
    return [json.loads(line) for line in path.read_text("utf-8").splitlines()] if path.exists() else []


def decisions(shop: Shop) -> list[tuple[int, str, list[str]]]:
    return [(line["hit"], line["decision"], line["codes"]) for line in journal(shop) if line["kind"] == "hit"]


def stiffness(shop: Shop) -> float:
    value: float = shop.logbook.history.rows[-1].stiffness.value
    return value


def chosen(file: Path, *numbers: int) -> list[Hit]:
    hits = read_hits(file)
    return [hits[number - 1] for number in numbers]


def test_of_a_file_each_hit_is_named_and_the_decided_ones_are_averaged(file: Path) -> None:
    assert [check_hit(hit).codes for hit in read_hits(file)] == [
        (), (), ("overload-force",), (), ("no-response",), (),
    ]  # fmt: skip
    plain = json.loads(run("modes", file, "--json").stdout)
    assert [hit["number"] for hit in plain["hits"] if not hit["used"]] == [CLIPPED, SILENT]
    assert plain["n_averages"] == 4
    said = run("modes", file, "--accept-hit", f"{CLIPPED}:overload-force", "--reject-hit", WIDER, "--json")
    decided = json.loads(said.stdout)
    assert [hit["number"] for hit in decided["hits"] if hit["used"]] == [1, 3, 4, 6]
    assert {remark["code"] for remark in decided["remarks"]} >= {"hits-by-hand", "hits-overloaded"}
    made = HitDecision(WIDER, "reject"), HitDecision(CLIPPED, "accept", ("overload-force",))
    frf = fit_file_modes(file, description=Description(hit_decisions=made)).frf
    assert frf is not None
    assert np.array_equal(frf.receptance, estimate_frf(chosen(file, 1, 3, 4, 6)).receptance)


def test_a_replayed_file_keeps_the_decision_in_the_journal_and_its_verdicts_in_the_tap_file(
    shop: Shop, file: Path
) -> None:
    said = run("replay", shop.path, file, *DATED, "--accept-hit", f"{CLIPPED}:overload-force", "--reject-hit", WIDER)
    assert said.exit_code == 0
    assert [line["kind"] for line in journal(shop)] == ["hit", "hit", "tap"]
    assert decisions(shop) == [(WIDER, "reject", []), (CLIPPED, "accept", ["overload-force"])]
    (entry,) = shop.logbook.taps
    stored = read_tap(shop.path / entry.file)
    assert stored.flags[CLIPPED - 1] is HitFlags.OVERLOAD_FORCE
    assert stored.flags[WIDER - 1] is HitFlags.OK
    expected = estimate_frf(chosen(file, 1, 3, 4, 6)).receptance
    for tap in (stored, shop.folder.read(entry)):
        assert np.allclose(tap.required_frf.receptance, expected, rtol=1e-12, atol=0)
    fresh = stiffness(shop)
    (shop.path / "history.rows").unlink()
    assert stiffness(shop) == fresh


def test_a_stored_tap_test_is_decided_afterwards_and_no_byte_of_its_file_changes(shop: Shop, file: Path) -> None:
    run("replay", shop.path, file, *DATED)
    (entry,) = shop.logbook.taps
    path, before = shop.path / entry.file, stiffness(shop)
    digest = hashlib.sha256(path.read_bytes()).hexdigest()
    said = json.loads(run("modes", shop.path, entry.id[:15], "--reject-hit", WIDER, "--json").stdout)
    assert (said["n_averages"], decisions(shop)) == (3, [(WIDER, "reject", [])])
    rejected = stiffness(shop)
    assert rejected > 1.01 * before
    remarks = shop.logbook.history.rows[-1].remarks
    assert ("hits-by-hand", f"reject {WIDER}") in [(remark.code, remark.about) for remark in remarks]
    (tap,) = json.loads(run("history", shop.path, "--json").stdout)["taps"]
    assert tap["hit_decisions"] == [{"hit": WIDER, "decision": "reject", "codes": []}]
    for again in (lambda: (shop.path / "history.rows").unlink(), lambda: run("rebuild", shop.path)):
        again()
        assert stiffness(shop) == rejected
    assert run("verify", shop.path).exit_code == 0
    assert hashlib.sha256(path.read_bytes()).hexdigest() == digest == entry.sha256
    run("modes", shop.path, entry.id, "--undo-hit", WIDER)
    assert stiffness(shop) == before
    assert decisions(shop)[-1] == (WIDER, "undo", [])


def test_of_two_decisions_the_later_one_counts_and_others_stay(shop: Shop, file: Path) -> None:
    run("replay", shop.path, file, *DATED, "--reject-hit", 1)
    (entry,) = shop.logbook.taps
    for option in (["--accept-hit", f"{CLIPPED}:overload-force"], ["--reject-hit", CLIPPED]):
        assert run("modes", shop.path, entry.id, *option).exit_code == 0
    (entry,) = shop.logbook.taps
    assert entry.hit_decisions == (HitDecision(1, "reject"), HitDecision(CLIPPED, "reject"))


def test_a_worker_fits_the_decided_hits(shop: Shop, file: Path) -> None:
    run("replay", shop.path, file, *DATED, "--reject-hit", WIDER)
    (entry,) = shop.logbook.taps
    fit = fit_tap_bytes(TapFileBytes(entry, (shop.path / entry.file).read_bytes(), shop.folder.toml_text))
    assert fit is not None
    assert [mode.stiffness for mode in fit.modes] == [m.stiffness for m in shop.logbook.measurement(entry.id).modes]


def test_a_file_that_is_stored_already_gets_the_decision_once(shop: Shop, file: Path) -> None:
    run("replay", shop.path, file, *DATED)
    for _ in range(2):
        assert run("replay", shop.path, file, *DATED, "--reject-hit", WIDER).exit_code == 0
    assert [line["kind"] for line in journal(shop)] == ["tap", "hit"]


def test_a_file_without_a_good_hit_is_stored_once_a_hit_is_accepted(shop: Shop, file: Path) -> None:
    rows = file.read_text("utf-8").splitlines()
    first = 1 + (CLIPPED - 1) * N
    file.write_text("\n".join([rows[0], *rows[first : first + N]]), "utf-8")
    assert run("replay", shop.path, file, *DATED).exit_code
    assert run("replay", shop.path, file, *DATED, "--accept-hit", "1:overload-force").exit_code == 0
    assert shop.folder.read(shop.logbook.taps[-1]).required_frf.n_averages == 1


def test_a_preview_shows_the_decided_hits_and_stores_nothing(shop: Shop, file: Path) -> None:
    said = run("replay", shop.path, file, *DATED, "--reject-hit", WIDER, "--dry-run", "--json")
    (preview,) = json.loads(said.stdout)["files"]
    assert [hit["number"] for hit in preview["hit_list"] if hit["used"]] == [1, 4, 6]
    assert journal(shop) == []


@pytest.mark.parametrize(
    "options",
    [
        ["--accept-hit", "7:too-soft"],
        ["--accept-hit", "0:too-soft"],
        ["--accept-hit", "3:clipped"],
        ["--accept-hit", "3"],
        ["--accept-hit", "3:double-hit"],
        ["--accept-hit", "1:double-hit"],
        ["--accept-hit", f"{SILENT}:no-response"],
        ["--reject-hit", "9"],
        ["--reject-hit", "1", "--accept-hit", "1:too-soft"],
        [option for number in (1, 2, 4, 6) for option in ("--reject-hit", number)],
    ],
    ids=str,
)
def test_a_wrong_decision_is_one_error_and_stores_nothing(shop: Shop, file: Path, options: list[object]) -> None:
    for command in (["modes", file], ["replay", shop.path, file, *DATED]):
        said = run(*command, *options)
        assert isinstance(said.exception, ValueError)
        assert not said.stdout
    assert journal(shop) == []
    run("replay", shop.path, file, *DATED)
    (entry,) = shop.logbook.taps
    assert isinstance(run("modes", shop.path, entry.id, *options).exception, ValueError)
    assert decisions(shop) == []


def test_decisions_need_one_file_and_only_a_stored_one_can_be_withdrawn(shop: Shop, file: Path, tmp_path: Path) -> None:
    other = tmp_path / "other.csv"
    other.write_bytes(file.read_bytes() + b"\n")
    assert run("replay", shop.path, file, other, *DATED, "--reject-hit", 1).exit_code
    assert run("modes", file, "--undo-hit", 1).exit_code
    run("replay", shop.path, file, *DATED)
    assert run("modes", shop.path, shop.logbook.taps[-1].id, "--undo-hit", 1).exit_code
    assert decisions(shop) == []


def test_a_tap_file_is_counted_by_all_its_hits(shop: Shop, file: Path) -> None:
    """A hit that was undone is not read from a tap file, but keeps its number."""
    run("replay", shop.path, file, *DATED, "--reject-hit", 1)
    (entry,) = shop.logbook.taps
    said = json.loads(run("modes", shop.path, entry.id, "--accept-hit", f"{CLIPPED}:overload-force", "--json").stdout)
    assert [hit["number"] for hit in said["hits"] if hit["used"]] == [2, 3, 4, 6]
    path = MachineFolder(shop.path).path / entry.file
    said = json.loads(run("modes", path, "--reject-hit", 6, "--json").stdout)
    assert [hit["number"] for hit in said["hits"] if hit["used"]] == [1, 2, 4]


def test_hits_of_several_files_are_counted_through_and_named_by_file(shop: Shop, file: Path, tmp_path: Path) -> None:
    rows = file.read_text("utf-8").splitlines()
    files = [tmp_path / f"hit{number}.csv" for number in range(1, 7)]
    for number, path in enumerate(files):
        path.write_text("\n".join([rows[0], *rows[1 + number * N : 1 + (number + 1) * N]]), "utf-8")
    said = run("replay", shop.path, *files, "--one-test", *DATED, "--accept-hit", f"{CLIPPED}:overload-force")
    assert said.exit_code == 0
    assert f"hit{SILENT}.csv" in said.stderr
    assert f"hit{CLIPPED}.csv" not in said.stderr
    (tap,) = shop.logbook.taps
    assert shop.folder.read(tap).accepted[2].force.max() == pytest.approx(read_hits(files[2])[0].force.max())


def test_the_report_and_the_replay_name_the_hits(shop: Shop, file: Path) -> None:
    said = run("replay", shop.path, file, *DATED, "--reject-hit", WIDER)
    for number in (WIDER, CLIPPED, SILENT):
        assert f"hit {number} (" in said.stderr
    assert run("report", shop.path).exit_code == 0
    assert f"reject {WIDER}" in (shop.path / "report.html").read_text("utf-8")


def used(said: Result) -> list[int]:
    return [hit["number"] for hit in json.loads(said.stdout)["hits"] if hit["used"]]


def test_a_withdrawn_decision_of_the_replay_leaves_no_trace_in_the_result(shop: Shop, file: Path) -> None:
    run("replay", shop.path, file, *DATED, "--reject-hit", WIDER, "--accept-hit", f"{CLIPPED}:overload-force")
    (entry,) = shop.logbook.taps
    run("modes", shop.path, entry.id, "--undo-hit", WIDER)
    said = run("modes", shop.path, entry.id, "--undo-hit", CLIPPED, "--json")
    assert used(said) == [1, 2, 4, 6]
    expected = estimate_frf(chosen(file, 1, 2, 4, 6)).receptance
    path = shop.path / entry.file
    withdrawn = shop.folder.read(shop.logbook.taps[-1])
    for frf in (withdrawn.required_frf, read_frf(path), fit_file_modes(path).frf):
        assert frf is not None
        assert frf.n_averages == 4
        assert np.allclose(frf.receptance, expected, rtol=1e-12, atol=0)


def test_a_rebuilt_journal_without_decisions_gives_the_result_of_the_verdicts(shop: Shop, file: Path) -> None:
    run("replay", shop.path, file, *DATED, "--reject-hit", WIDER)
    for path in shop.path.glob("journal*.jsonl"):
        path.unlink()
    run("rebuild", shop.path)
    (entry,) = shop.logbook.taps
    assert entry.hit_decisions == ()
    expected = estimate_frf(chosen(file, 1, 2, 4, 6)).receptance
    assert np.allclose(shop.folder.read(entry).required_frf.receptance, expected, rtol=1e-12, atol=0)
    assert shop.logbook.measurement(entry.id).modes[0].n_hits == 4


def test_a_tap_test_of_one_accepted_hit_opens_without_its_journal(shop: Shop, file: Path) -> None:
    rows = file.read_text("utf-8").splitlines()
    first = 1 + (CLIPPED - 1) * N
    file.write_text("\n".join([rows[0], *rows[first : first + N]]), "utf-8")
    run("replay", shop.path, file, *DATED, "--accept-hit", "1:overload-force")
    for path in shop.path.glob("journal*.jsonl"):
        path.unlink()
    run("rebuild", shop.path)
    tap = shop.folder.read(shop.logbook.taps[-1])
    assert (tap.required_frf.n_averages, len(tap.accepted)) == (1, 1)
    assert isinstance(run("modes", shop.path, tap.id, "--reject-hit", 1).exception, ValueError)


@pytest.fixture
def live(file: Path, tmp_path: Path) -> Path:
    """Write a tap file of which hit 1 was undone and hit 4 is inconsistent, which its signals do not show."""
    hits = tuple(read_hits(file))
    flags = [*map(check_hit, hits)]
    flags[0], flags[3] = HitFlags.UNDONE, HitFlags.INCONSISTENT
    about = Circumstances("Mill 3", datetime(2026, 3, 2, 9, 30, tzinfo=UTC))
    tap = TapTest(new_tap_id(about), about, estimate_frf([hits[WIDER - 1], hits[5]]), hits, tuple(flags))
    write_tap(path := tmp_path / "live.h5", tap)
    return path


def test_all_commands_number_the_hits_of_a_tap_file_alike(shop: Shop, live: Path) -> None:
    plain, decided = run("modes", live, "--json"), run("modes", live, "--reject-hit", 6, "--json")
    assert (used(plain), used(decided)) == ([2, 6], [2])
    assert [json.loads(said.stdout)["n_hits_found"] for said in (plain, decided)] == [6, 6]
    said = json.loads(run("replay", shop.path, live, "--reject-hit", 6, "--json").stdout)
    (tap_id,) = said["hits"]
    assert said["hits"][tap_id] == {"found": 6, "used": 1}
    (entry,) = shop.logbook.taps
    assert used(run("modes", shop.path, entry.id, "--json")) == [2]
    assert shop.folder.read(entry).flags == read_tap(live).flags


def test_edits_that_do_not_fit_store_no_decision(shop: Shop, file: Path) -> None:
    run("replay", shop.path, file, *DATED)
    (entry,) = shop.logbook.taps
    said = run("modes", shop.path, entry.id, "--reject-hit", WIDER, "--drop", 99999)
    assert isinstance(said.exception, ValueError)
    assert [line["kind"] for line in journal(shop)] == ["tap"]


def test_decisions_on_an_frf_are_refused(tmp_path: Path) -> None:
    frf = synthesize_frf([Mode(1713.0, 0.03, 3.5e7)], np.arange(1000.0, 2500.0))
    table = np.column_stack([frf.frequency, frf.receptance.real, frf.receptance.imag])
    path, header = tmp_path / "frf.csv", "frequency [Hz],real [m/N],imag [m/N]"
    np.savetxt(path, table, delimiter=",", header=header, comments="")
    assert run("modes", path).exit_code == 0
    for option in (["--reject-hit", 1], ["--accept-hit", "1:double-hit"]):
        assert isinstance(run("modes", path, *option).exception, ValueError)


def test_hits_with_an_accepted_fault_count_as_averaged(file: Path) -> None:
    said = run("modes", file, "--accept", "overload-(force)", "--json")
    assert used(said) == [1, 2, 3, 4, 6]
    assert json.loads(said.stdout)["n_averages"] == 5
    assert f"hit {CLIPPED} (" not in run("modes", file, "--accept", "overload-(force)").stdout


def test_the_unused_hits_are_named_once_and_without_a_second_count() -> None:
    flags = HitFlags.OK, HitFlags.DOUBLE_HIT | HitFlags.UNDONE, HitFlags.UNDONE
    assert format_unused_hits(flags[:1]) == ""
    said = format_unused_hits(flags)
    assert ("hit 1" in said, "hit 2" in said, "hit 3" in said) == (False, True, True)
    assert " of " not in said
    assert HitFlags.UNDONE.words not in said


def test_a_stored_tap_test_with_a_new_decision_is_shown(shop: Shop, file: Path) -> None:
    run("replay", shop.path, file, *DATED)
    (entry,) = shop.logbook.taps
    for expected in ([entry.id], []):
        outcome = shop.logbook.replay_all([file], Description(hit_decisions=(HitDecision(WIDER, "reject"),)))
        assert outcome.decided_tap_ids == expected
    said = json.loads(run("replay", shop.path, file, *DATED, "--reject-hit", 1, "--json").stdout)
    assert [measured["tap_id"] for measured in said["measurements"]] == [entry.id]


def test_a_preview_of_a_stored_file_checks_the_decisions(shop: Shop, file: Path) -> None:
    run("replay", shop.path, file, *DATED)
    assert isinstance(run("replay", shop.path, file, "--reject-hit", 99, "--dry-run").exception, ValueError)
    assert run("replay", shop.path, file, "--reject-hit", 1, "--dry-run").exit_code == 0
    assert decisions(shop) == []
