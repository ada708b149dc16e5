"""Test cuts as journal lines, their recordings in the folder, and the effects of damage."""

from __future__ import annotations

import csv
import io
import json
import re
from dataclasses import asdict, replace
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from typer.testing import CliRunner, Result

from acquisition import Channel, DataError
from acquisition.files.cut_file import CutSignal, read_cut_signal
from lobewatch.cli import app
from lobewatch.logbook import Logbook
from lobewatch.machine import MachineFolder
from lobewatch.machine.folder_updates import exclude_entry, include_entry, make_observed_cut, store_cut
from lobewatch.machine.journal.entries import CutEntry, parse_cut_line
from lobewatch.machine.rebuild_files import rebuild_files
from lobewatch.machine.settings.requested_cut import find_by_name, find_cut_setting
from lobewatch.machine.verify_files import verify
from lobewatch.show.history import untapped_remarks
from lobewatch.show.terminal.option_names import with_option_names

Shop = Any
"""Machine fixture of tests/lobewatch/conftest.py."""
CHANNEL = Channel("acceleration", 1.02e-2, 5.0)
CODES = np.random.default_rng(0).integers(-900, 900, 3000).astype(np.int32)


def run(shop: Shop, command: str, *arguments: object) -> Result:
    return CliRunner().invoke(app, [command, str(shop.path), *map(str, arguments)])


def heard(shop: Shop, speed: float = 12000.0, depth: float = 2.0) -> CutEntry:
    setting = find_cut_setting(shop.folder.machine, "A", speed, depth)
    return replace(make_observed_cut(setting, "chatter", 1650.0), by="accelerometer", speed_rpm=speed * 1.004)


def signal() -> CutSignal:
    return CutSignal(np.asarray(CODES * CHANNEL.scale, np.float64), 51200.0, CODES, CHANNEL, lost_scans=3)


def test_a_program_is_found_by_how_its_name_begins() -> None:
    tables: dict[str, Any] = {"A": 1, "A: slot": 2, "B: rib": 3, "B: slot": 4}
    assert [find_by_name(tables, name) for name in ("A", "A:", "B: r")] == [1, 2, 3]
    with pytest.raises(ValueError, match=r"'B' .*'B: rib', 'B: slot'"):
        find_by_name(tables, "B")


def test_what_was_detected_is_in_both_copies_with_all_that_it_is_evaluated_by(shop: Shop) -> None:
    told = ("--speed", 12000, "--depth", 2, "--chatter", "--frequency", 1650, "--date", "2026-02-01T10:00:00")
    assert run(shop, "observe", "--program", "A", *told, "--json").exit_code == 0
    (cut,) = shop.logbook.cuts
    assert (cut.id, cut.program, cut.tool, cut.word, cut.by) == ("c1", "A", "reference", "chatter", "ear")
    assert (cut.speed_rpm, cut.depth, cut.chatter_frequency_hz) == (12000.0, 0.002, 1650.0)
    assert cut.at == datetime(2026, 2, 1, 10).astimezone(UTC)
    assert (cut.cut.teeth, cut.cut.immersion, cut.cut.tangential, cut.feed) == (4, 1.0, 1400e6, "both")
    lines = (shop.path / "journal.jsonl").read_bytes()
    assert lines == (shop.path / "journal.copy.jsonl").read_bytes()
    assert json.loads(lines.splitlines()[-1])["kind"] == "cut"


def test_a_cut_keeps_what_it_was_cut_with_when_the_machine_file_changes(shop: Shop) -> None:
    assert run(shop, "observe", "--program", "A", "--stable").exit_code == 0
    shop.edit("tangential_n_per_mm2 = 1400", "tangential_n_per_mm2 = 2800")
    assert shop.logbook.cuts[0].cut.tangential == 1400e6


FEED = ("radial_depth_mm = 20", "radial_depth_mm = 20\nfeed_per_tooth_mm = 0.1")
"""Change of machine.toml after which power says a Kt."""


def test_the_power_of_a_cut_is_in_its_line_with_the_kt_that_it_says(shop: Shop) -> None:
    """Slot at 12 900 rpm, 1.5 mm deep: 1.1 times Kt of 1400 N/mm2 and edges of 42 N/mm on half a turn."""
    shop.edit(*FEED)
    rate = 4 * 215 * 1.5e-3 * 0.02
    watts = 1.1 * rate * (1.4e9 * 1e-4 + 42e3 * np.pi / 2)
    result = run(shop, "observe", "--program", "A", "--stable", "--power", watts / 1e3)
    assert re.search(rf"{watts / 1e3:.4g} kW.*Kt 1540 N/mm2.* 1400", result.stdout)
    (cut,) = shop.logbook.cuts
    assert cut.power is not None
    assert (cut.power.watts, cut.power.tangential) == pytest.approx((watts, 1.54e9))
    assert cut.power.edge_share == pytest.approx(42e3 * np.pi / 2 / 1.4e5)
    assert not cut.power.edge_known
    line = json.loads((shop.path / "journal.jsonl").read_bytes().splitlines()[-1])
    assert line["power"] == asdict(cut.power)
    shop.edit("tangential_n_per_mm2 = 1400", "tangential_n_per_mm2 = 2800")
    assert shop.logbook.cuts == (cut,)
    (listed,) = json.loads(run(shop, "history", "--json").stdout)["cuts"]
    assert listed["power_kw"] == pytest.approx(watts / 1e3)
    assert listed["tangential_by_power_n_per_mm2"] == pytest.approx(1540)
    assert "Kt 1540 N/mm2" in " ".join(run(shop, "history").stdout.split())


def test_a_line_from_before_there_was_any_power_is_read_as_it_was(shop: Shop) -> None:
    cut = replace(heard(shop), id="c1")
    line = {name: value for name, value in cut.line.items() if name != "power"}
    assert parse_cut_line(line) == parse_cut_line(cut.line) == cut


def test_a_kte_that_is_known_counts_in_its_ratio_to_kt(shop: Shop) -> None:
    shop.edit(*FEED)
    shop.edit("tangential_n_per_mm2 = 1400\nradial_n_per_mm2 = 500\nspeed", 'material = "own"\nspeed')
    own = "tangential_n_per_mm2 = 700\nradial_n_per_mm2 = 200\ntangential_edge_n_per_mm = 10"
    shop.edit("[reference_cut]", f'[[material]]\nname = "own"\n{own}\n\n[reference_cut]')
    setting = find_cut_setting(
        shop.folder.machine, "A", 12000, 1.0, 8 / 7 * 4 * 200 * 1e-3 * 0.02 * (7e4 + 1e4 * np.pi / 2) / 1e3
    )
    power = make_observed_cut(setting, "stable").power
    assert power is not None
    assert power.edge_known
    assert power.tangential == pytest.approx(8e8)


@pytest.mark.parametrize(
    ("power", "facts"),
    [
        ("0", "--power 0 .*above 0.* kW"),
        ("nan", "--power nan .*above 0.* kW"),
        ("5300", r"--power 5300 .*power_kw=15 of \[drive\]"),
        ("14.9", "--power 14.9 .*0.66 to 11 kW .*700 N/mm2"),
        ("0.65", "--power 0.65 .*0.66 to 11 kW .*700 N/mm2"),
    ],
)
def test_a_power_that_cannot_be_is_rejected_and_not_kept(shop: Shop, power: str, facts: str) -> None:
    shop.edit(*FEED)
    shop.edit("tangential_n_per_mm2 = 1400", "tangential_n_per_mm2 = 700")
    shop.edit("[reference_cut]", "[drive]\npower_kw = 15\n\n[reference_cut]")
    result = run(shop, "observe", "--program", "A", "--stable", "--power", power)
    assert re.search(facts, with_option_names(str(result.exception)))
    assert shop.logbook.cuts == ()


@pytest.mark.parametrize(
    ("radial", "more", "facts"),
    [
        ("20", "", r"--power 3 .*feed_per_tooth_mm.* machine\.toml"),
        ("[5, 20]", "feed_per_tooth_mm = 0.1", "--power 3 .*radial depth"),
        ("10", "feed_per_tooth_mm = 0.1\ncorner_radius_mm = 12", "--power 3 .*radial depth"),
    ],
)
def test_a_power_that_says_nothing_of_kt_is_rejected(shop: Shop, radial: str, more: str, facts: str) -> None:
    shop.run(("A", 12900, 1.5), more=more)
    shop.edit("radial_depth_mm = 20\ndirection", f"radial_depth_mm = {radial}\ndirection")
    result = run(shop, "observe", "--program", "A", "--stable", "--power", "3.0")
    assert re.search(facts, with_option_names(str(result.exception)))
    assert shop.logbook.cuts == ()


@pytest.mark.parametrize(
    ("arguments", "facts"),
    [
        (("--program", "A", "--stable", "--speed", 0), "--speed 0 .*above 0.* rpm"),
        (("--program", "A", "--stable", "--depth", 0), "--depth 0 .*above 0.* mm"),
        (("--program", "A", "--stable", "--depth", "nan"), "--depth nan .*above 0.* mm"),
        (("--program", "A"), "--stable .*--chatter"),
        (("--program", "A", "--stable", "--chatter"), "--stable .*--chatter"),
        (("--program", "A", "--stable", "--frequency", 1650), "--frequency 1650 .*--chatter"),
        (("--program", "A", "--chatter", "--frequency", -5), "--frequency -5 .*0 and 100000.* Hz"),
        (("--program", "A", "--chatter", "--speed", 12000, "--frequency", 1601), "1601 .*2 times .* 800 Hz"),
        (("--program", "Q", "--stable"), r"'Q' .*machine\.toml.* 'reference cut', 'A', 'B'"),
        (("--program", "A", "--stable", "--date", "2126-01-01"), "--date 2126-01-01 .*future"),
    ],
)
def test_what_cannot_be_is_rejected_in_a_sentence_and_not_kept(
    shop: Shop, arguments: tuple[object, ...], facts: str
) -> None:
    result = run(shop, "observe", *arguments)
    assert result.exit_code != 0
    assert re.search(facts, with_option_names(str(result.exception)))
    assert not (shop.path / "journal.jsonl").exists()


def test_a_tool_never_tapped_and_an_earlier_word_at_the_same_point_are_reported_and_all_is_kept(shop: Shop) -> None:
    first = run(shop, "observe", "--program", "A", "--stable", "--json")
    again = run(shop, "observe", "--program", "A", "--chatter", "--speed", 12910, "--json")
    other = run(shop, "observe", "--program", "A", "--chatter", "--speed", 12500, "--json")
    shop.tap(0, 1713.0)
    said = [json.loads(one.stdout)["remarks"] for one in (first, again, other)]
    assert said == [["tool-not-tapped"], ["tool-not-tapped", "cuts-contradict"], ["tool-not-tapped"]]
    assert [cut.word for cut in shop.logbook.cuts] == ["stable", "chatter", "chatter"]
    assert untapped_remarks(shop.logbook, shop.logbook.cuts[0]) == []


def test_a_cut_is_taken_out_and_back_and_listed_each_time(shop: Shop) -> None:
    run(shop, "observe", "--program", "A", "--chatter", "--frequency", 1650, "--speed", 12000)
    assert run(shop, "exclude", "c1", "--reason", "chips in the flutes").exit_code == 0
    assert shop.logbook.cuts == ()
    assert "excluded" in (text := run(shop, "history").stdout)
    assert "chips in the flutes" in text
    assert run(shop, "include", "c1").exit_code == 0
    assert len(shop.logbook.cuts) == 1
    (listed,) = json.loads(run(shop, "history", "--json").stdout)["cuts"]
    assert (listed["id"], listed["speed_rpm"], listed["depth_mm"]) == ("c1", 12000.0, 1.5)
    (row,) = csv.DictReader(io.StringIO(run(shop, "history", "--csv").stdout))
    assert row["kind"] == "cut"
    assert "1650 Hz" in row["text"]
    assert re.search("A at 12000 rpm, 1.5 mm: .*1650 Hz", run(shop, "history").stdout)


def test_excluding_a_cut_that_is_none_or_twice_is_rejected(shop: Shop) -> None:
    store_cut(shop.folder, heard(shop))
    exclude_entry(shop.folder, "c1", "no")
    with pytest.raises(ValueError, match=r"c1 .*'no'"):
        exclude_entry(shop.folder, "c1", "no")
    with pytest.raises(ValueError, match=r"'c2' .*MachineFolder.contents"):
        include_entry(shop.folder, "c2")


def test_a_recording_is_the_one_that_was_kept_and_its_line_vouches_for_it(shop: Shop) -> None:
    kept = store_cut(shop.folder, heard(shop), signal())
    assert shop.logbook.cuts == (kept,)
    assert kept.recording is not None
    assert kept.recording.file == "cuts/c1.h5"
    found, about = read_cut_signal(shop.path / kept.recording.file)
    assert found.codes is not None
    assert found.codes.tolist() == CODES.tolist()
    assert np.array_equal(found.acceleration, signal().acceleration)
    assert (found.sample_rate, found.channel, found.lost_scans) == (51200.0, CHANNEL, 3)
    assert about["id"] == "c1"
    assert about["commanded_rpm"] == 12000.0
    assert verify(shop.path).damage == ()


def damaged(path: Path) -> None:
    content = path.read_bytes()
    path.write_bytes(content[:900] + bytes([content[900] ^ 1]) + content[901:])


@pytest.mark.parametrize("harm", [damaged, Path.unlink])
def test_a_damaged_recording_is_named_and_mended_and_its_verdict_goes_on_to_count(shop: Shop, harm: Any) -> None:
    store_cut(shop.folder, heard(shop), signal())
    path = shop.path / "cuts" / "c1.h5"
    harm(path)
    assert [(one.code, one.about) for one in verify(shop.path).damage] == [("cut-damaged", "cuts/c1.h5")]
    assert [cut.id for cut in shop.logbook.cuts] == ["c1"]
    (report,) = rebuild_files(shop.path)
    assert report.startswith("cuts/c1.h5: lost")
    assert verify(shop.path).damage == ()
    assert "cut-lost" in [one.code for one in verify(shop.path).remarks]
    assert [cut.id for cut in shop.logbook.cuts] == ["c1"]
    assert store_cut(shop.folder, heard(shop), signal()).id == "c2"


def test_a_recording_whose_line_a_crash_has_kept_away_is_entered_by_rebuild_and_never_overwritten(shop: Shop) -> None:
    store_cut(shop.folder, heard(shop), signal())
    kept = shop.logbook.cuts[0]
    for name in ("journal.jsonl", "journal.copy.jsonl"):
        (shop.path / name).unlink()
    assert store_cut(shop.folder, heard(shop, 9000.0)).id == "c2"
    assert [one.code for one in verify(shop.path).damage] == ["cut-unlisted"]
    (report,) = rebuild_files(shop.path)
    assert report.startswith("cuts/c1.h5: ")
    assert kept in shop.logbook.cuts
    assert verify(shop.path).damage == ()


def test_a_foreign_file_among_the_recordings_is_put_aside(shop: Shop) -> None:
    store_cut(shop.folder, heard(shop), signal())
    (shop.path / "cuts" / "c7.h5").write_bytes((shop.path / "cuts" / "c1.h5").read_bytes())
    assert [one.code for one in verify(shop.path).damage] == ["cut-unlisted"]
    (report,) = rebuild_files(shop.path)
    assert re.search(r"cuts/c7\.h5: .*damaged/c7\.h5", report)
    assert (shop.path / "damaged" / "c7.h5").exists()
    assert verify(shop.path).damage == ()


def test_nothing_is_kept_while_the_journal_is_damaged(shop: Shop) -> None:
    store_cut(shop.folder, heard(shop))
    (shop.path / "journal.jsonl").write_bytes(b"{}\n")
    with pytest.raises(DataError, match=r"journal\.jsonl: .*line 1 .*lobewatch rebuild"):
        store_cut(MachineFolder(shop.path), heard(shop), signal())
    assert not (shop.path / "cuts").exists()


def test_what_cannot_be_classified_teaches_nothing_and_is_kept(shop: Shop) -> None:
    store_cut(shop.folder, replace(heard(shop), word="cannot tell", chatter_frequency_hz=None, reason="overload"))
    logbook = Logbook.open(shop.path)
    assert logbook.cuts == ()
    assert len(logbook.files.contents.cuts) == 1
