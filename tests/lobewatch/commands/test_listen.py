"""`lobewatch listen` with files: verdict, JSON, stored data, picture, and rejected input."""

from __future__ import annotations

import json
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import scipy.io.wavfile
from typer.testing import CliRunner, Result

from acquisition.files.read_cut import read_cut_recording
from lobewatch.cli import app
from lobewatch.logbook import Logbook
from lobewatch.logbook.analysis import Analysis
from lobewatch.logbook.cut_comparison import compare_cuts
from lobewatch.machine.settings.requested_cut import find_cut_setting
from lobewatch.machine.verify_files import verify
from lobewatch.show.terminal.option_names import with_option_names

Shop = Any
"""Machine fixture of tests/lobewatch/conftest.py."""
RATE, TURN = 25600.0, 12077.0 / 60


def recording(path: Path, chatter: float | None = None, seconds: float = 1.2) -> Path:
    """Write MATLAB text of a cut with four teeth at 12 077 rpm: time and acceleration."""
    random, n = np.random.default_rng(0), round((seconds + 0.8) * RATE)
    time, begin = np.arange(n) / RATE, round(0.5 * RATE)
    signal = random.normal(scale=0.05, size=n)
    lines = [(4 * k * TURN, 20.0 / k) for k in range(1, 12)]
    if chatter is not None:
        lines += [(chatter + 4 * k * TURN, 30.0 * 0.2**k) for k in range(4)]
    for frequency, amplitude in lines:
        inside = slice(begin, begin + round(seconds * RATE))
        signal[inside] += amplitude * np.sin(2 * np.pi * frequency * time[inside] + random.uniform(0, 6))
    rows = "\n".join(f"{t:.8f},{a:.5f}" for t, a in zip(time, signal, strict=True))
    path.write_text(f"time [s],acceleration [m/s^2]\n{rows}\n")
    return path


def run(shop: Shop, *arguments: object) -> Result:
    result = CliRunner().invoke(app, ["listen", str(shop.path), *map(str, arguments)])
    if isinstance(result.exception, ValueError | OSError):
        result.exception.args = (with_option_names(str(result.exception)),)
    return result


def test_chatter_in_a_file_is_reported_kept_and_drawn(shop: Shop, tmp_path: Path) -> None:
    file, picture = recording(tmp_path / "cut.csv", 1712.3), tmp_path / "cut.svg"
    result = run(shop, "--program", "A", "--speed", 12000, "--depth", 3, "--file", file, "--json", "--out", picture)
    told = json.loads(result.stdout)
    assert (told["word"], told["reason"], told["id"]) == ("chatter", "", "c1")
    assert told["chatter_frequency_hz"] == pytest.approx(1712.3, abs=0.1)
    assert told["speed_rpm"] == pytest.approx(12077.0, rel=2e-5)
    assert told["commanded_rpm"] == 12000.0
    assert told["lobe"] == 2
    (cut,) = shop.logbook.cuts
    assert (cut.by, cut.word, cut.program, cut.depth) == ("accelerometer", "chatter", "A", 0.003)
    assert cut.speed_rpm == pytest.approx(12077.0, rel=2e-5)
    assert cut.recording is not None
    assert verify(shop.path).damage == ()
    assert "chatter at 1712" in picture.read_text("utf-8")


def test_the_power_of_a_cut_says_a_kt_at_the_speed_that_was_detected(shop: Shop, tmp_path: Path) -> None:
    """0.64 % faster than set: as much less Kt. An impossible power is rejected before the analysis."""
    shop.run(("A", 12000, 1.5), more="feed_per_tooth_mm = 0.1")
    place = ("--program", "A", "--file", recording(tmp_path / "cut.csv"))
    told = json.loads(run(shop, *place, "--power", 4.0, "--json").stdout)
    observed = CliRunner().invoke(
        app,
        ["observe", str(shop.path), "--program", "A", "--speed", f"{told['speed_rpm']}", "--stable", "--power", "4.0"],
    )
    assert observed.exit_code == 0
    heard, by_ear = shop.logbook.cuts
    assert heard.power == by_ear.power
    assert told["power_kw"] == 4.0
    assert told["tangential_by_power_n_per_mm2"] == pytest.approx(heard.power.tangential / 1e6)
    text = run(shop, *place, "--power", 4.0, "--dry-run").stdout
    assert re.search(rf"4 kW.*{heard.power.tangential / 1e6:.0f} N/mm2.*1400", text)
    wrong = run(shop, *place, "--power", 4000)
    assert re.search("--power 4000.*1400", str(wrong.exception))
    assert len(shop.logbook.files.contents.cuts) == 2


def test_a_quiet_cut_is_stable_and_nothing_is_kept_without_wish(shop: Shop, tmp_path: Path) -> None:
    file = recording(tmp_path / "cut.csv")
    result = run(shop, "--cut", "reference cut", "--speed", 12000, "--depth", 1, "--file", file, "--dry-run")
    assert result.stdout.splitlines()[0] == "stable"
    assert "12077.0 rpm (+0.64 %" in result.stdout
    assert shop.logbook.files.contents.cuts == ()


def test_a_recording_that_is_kept_says_the_same_again(shop: Shop, tmp_path: Path) -> None:
    first = run(shop, "--program", "A", "--speed", 12000, "--file", recording(tmp_path / "cut.csv", 1712.3), "--json")
    kept = shop.path / "cuts" / "c1.h5"
    again = run(shop, "--program", "A", "--speed", 12000, "--file", kept, "--json", "--dry-run")
    one, other = json.loads(first.stdout), json.loads(again.stdout)
    assert other["chatter_frequency_hz"] == one["chatter_frequency_hz"]


def test_several_cuts_in_a_file_are_reported_and_kept_each_with_its_own_air(shop: Shop, tmp_path: Path) -> None:
    parts = [recording(tmp_path / f"{n}.csv", chatter, seconds=1.0) for n, chatter in enumerate((None, 1712.3))]
    values = [line.split(",")[1] for part in parts for line in part.read_text().splitlines()[1:]]
    rows = "\n".join(f"{n / RATE:.8f},{value}" for n, value in enumerate(values))
    file, picture = tmp_path / "both.csv", tmp_path / "both.svg"
    file.write_text(f"time [s],acceleration [m/s^2]\n{rows}\n")
    arguments = ("--program", "A", "--speed", 12000, "--depth", 3, "--file", file)
    cuts = json.loads(run(shop, *arguments, "--out", picture, "--json").stdout)["cuts"]
    assert [(cut["word"], cut["id"]) for cut in cuts] == [("stable", "c1"), ("chatter", "c2")]
    assert [cut["begin_s"] for cut in cuts] == pytest.approx([0.5, 2.3], abs=0.03)
    assert cuts[1]["remarks"] == ["tool-not-tapped", "cuts-contradict"]
    assert len(shop.logbook.cuts) == 2
    for name, word in (("c1", "stable"), ("c2", "chatter")):
        kept = shop.path / "cuts" / f"{name}.h5"
        again = run(shop, *arguments[:6], "--file", kept, "--json", "--dry-run")
        assert json.loads(again.stdout)["word"] == word
    text = run(shop, *arguments, "--dry-run").stdout
    assert "1 of 2, 0.5" in text
    assert "2 of 2, 2.3" in text
    assert "chatter at 1712" in picture.read_text("utf-8")


def trim_to_cut(path: Path, name: str) -> Path:
    """Write a recording of `recording` again without its air."""
    heading, *rows = path.read_text().splitlines()
    trimmed = path.with_name(name)
    trimmed.write_text("\n".join([heading, *rows[round(0.55 * RATE) : round(1.65 * RATE)]]) + "\n")
    return trimmed


@pytest.mark.parametrize("chatter", [None, 1712.3])
def test_a_cut_without_air_has_that_of_an_earlier_cut_at_its_speed(
    shop: Shop, tmp_path: Path, chatter: float | None
) -> None:
    shop.tap_both()  # a tool that was never tapped is judged without air
    place = ("--program", "A", "--speed", 12000, "--json")
    short = trim_to_cut(recording(tmp_path / "next.csv", chatter), "short.csv")
    alone = json.loads(run(shop, *place, "--file", short, "--dry-run").stdout)
    assert (alone["word"], alone["air_from"]) == ("cannot tell", None)
    whole = json.loads(run(shop, *place, "--file", recording(tmp_path / "cut.csv")).stdout)
    assert (whole["word"], whole["air_from"], whole["id"]) == ("stable", None, "c1")
    told = json.loads(run(shop, *place, "--file", short).stdout)
    assert (told["word"], told["air_from"], told["id"]) == ("chatter" if chatter else "stable", "c1", "c2")
    assert told["speed_rpm"] == pytest.approx(12077.0, rel=5e-5)
    assert (told["begin_s"], told["end_s"]) == pytest.approx((0.0, 1.1), abs=0.05)
    other = json.loads(run(shop, *place[:3], 12200, "--json", "--file", short, "--dry-run").stdout)
    assert (other["word"], other["air_from"]) == ("cannot tell", None)
    quiet = recording(tmp_path / "quiet.csv", seconds=0.05).read_text().splitlines()
    (tmp_path / "idle.csv").write_text("\n".join([quiet[0], *quiet[round(0.6 * RATE) :]]) + "\n")
    idle = json.loads(run(shop, *place, "--file", tmp_path / "idle.csv", "--dry-run").stdout)
    assert idle["word"] == "cannot tell"


def test_a_tone_that_nothing_explains_is_reported_with_its_distance_from_the_modes(shop: Shop, tmp_path: Path) -> None:
    shop.tap_both()
    time = np.arange(round(2.0 * RATE)) / RATE
    inside = (time > 0.5) & (time < 1.7)
    lines = [(4 * k * TURN, 20.0 / k) for k in range(1, 12)] + [(1712.3, 5.0)]
    signal = np.random.default_rng(0).normal(scale=0.05, size=time.size)
    signal += inside * sum(loud * np.sin(2 * np.pi * frequency * time + frequency) for frequency, loud in lines)
    file = tmp_path / "tone.csv"
    rows = "\n".join(f"{t:.8f},{a:.5f}" for t, a in zip(time, signal, strict=True))
    file.write_text(f"time [s],acceleration [m/s^2]\n{rows}\n")
    arguments = ("--program", "A", "--speed", 12000, "--file", file, "--dry-run")
    told = json.loads(run(shop, *arguments, "--json").stdout)
    assert (told["word"], told["reason"]) == ("cannot tell", "unexplained-tone")
    assert told["unexplained_tone_hz"] == pytest.approx(1712.3, abs=0.1)
    assembly = shop.logbook.query(Analysis.assembly_or_reason, "reference")
    modes = [mode.frequency for mode in (*assembly.x, *assembly.y)]
    nearest = min(modes, key=lambda mode: abs(mode - 1712.3))
    said = run(shop, *arguments).stdout.splitlines()[0]
    assert re.search(rf"1712\.3 Hz.* {abs(nearest - 1712.3):.1f} Hz .*{nearest:.1f} Hz", said)


def with_tacho(path: Path, chatter: float | None = None) -> Path:
    """Add a tachometer signal with two pulses a turn to the recording."""
    heading, *rows = recording(path, chatter).read_text().splitlines()
    pulses = np.where(np.arange(len(rows)) / RATE * 2 * TURN % 1 < 0.2, 4.8, 0.1)
    path.write_text("\n".join([f"{heading},S4", *(f"{row},{v}" for row, v in zip(rows, pulses, strict=True))]) + "\n")
    return path


def test_a_tachometer_is_followed_kept_and_contradicted(shop: Shop, tmp_path: Path) -> None:
    file = with_tacho(tmp_path / "cut.csv", 1712.3)
    arguments = ("--program", "A", "--speed", 9000, "--file", file, "--tacho", "S4")
    followed = json.loads(run(shop, *arguments, "--pulses", 2, "--json").stdout)
    assert (followed["word"], followed["id"]) == ("chatter", "c1")
    assert followed["measured_rpm"] == pytest.approx(12077.0, rel=1e-4)
    kept = run(shop, "--program", "A", "--speed", 9000, "--file", shop.path / "cuts" / "c1.h5", "--dry-run").stdout
    assert "chatter at 1712" in kept
    assert re.search(r"1207[67]\.\d rpm", kept)
    (line, *_) = run(shop, "--program", "A", "--speed", 12000, *arguments[4:], "--dry-run").stdout.splitlines()
    assert "tacho-contradicts" in line
    assert re.search(r"2415[34]\.\d rpm.*12077.0 rpm.*--pulses.*--speed", line)
    untold = json.loads(run(shop, *arguments[:6], "--columns", "time [s],acceleration [m/s^2],-", "--json").stdout)
    assert (untold["reason"], untold["measured_rpm"]) == ("speed-not-found", None)


def test_a_microphone_is_reported_and_kept_as_one(shop: Shop, tmp_path: Path) -> None:
    values = read_cut_recording(recording(tmp_path / "cut.csv", 1712.3)).acceleration
    scipy.io.wavfile.write(tmp_path / "cut.wav", int(RATE), (values / 200).astype(np.float32))
    arguments = ("--program", "A", "--speed", 12000, "--file", tmp_path / "cut.wav")
    assert "--full-scale" in str(run(shop, *arguments).exception)
    told = json.loads(run(shop, *arguments, "--sensor", "microphone", "--json").stdout)
    assert (told["word"], told["sensor"]) == ("chatter", "microphone")
    assert told["chatter_frequency_hz"] == pytest.approx(1712.3, abs=0.1)
    assert shop.logbook.cuts[0].by == "microphone"
    said = run(shop, *arguments[:4], "--file", shop.path / "cuts" / "c1.h5", "--dry-run").stdout
    assert "microphone" in said


def test_what_cannot_be_classified_says_why_and_is_kept_without_counting(shop: Shop, tmp_path: Path) -> None:
    file = recording(tmp_path / "cut.csv", seconds=0.05)
    told = json.loads(run(shop, "--program", "A", "--speed", 12000, "--file", file, "--json").stdout)
    assert (told["word"], told["reason"]) == ("cannot tell", "no-cut")
    assert (told["speed_rpm"], told["chatter_frequency_hz"]) == (None, None)
    assert shop.logbook.cuts == ()
    assert len(shop.logbook.files.contents.cuts) == 1


def test_nobody_listens_in_vain_where_nothing_can_be_written(shop: Shop, tmp_path: Path) -> None:
    (shop.path / "journal.jsonl").write_bytes(b"{}\n")
    result = run(shop, "--program", "A", "--port", "/dev/none")
    assert "journal.jsonl" in str(result.exception)


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        ((), ["--program", "--cut"]),
        (("--program", "A", "--cut", "B"), ["--program", "--cut"]),
        (("--cut", "A", "--depth", 2), ["--speed"]),
        (("--program", "A", "--depth", 0), ["--depth 0", "above 0"]),
        (("--program", "A", "--speed", -1), ["--speed -1", "above 0"]),
        (("--program", "Q"), ["'Q'", "machine.toml"]),
        (("--program", "A"), ["--port", "--file"]),
        (("--program", "A", "--port", "file:x.h5"), ["--file"]),
        (("--program", "A", "--file", "none.csv"), ["none.csv"]),
        (
            ("--program", "A", "--file", "none.csv", "--sensor", "ear"),
            ["--sensor ear", "accelerometer", "microphone"],
        ),
        (("--program", "A", "--port", "x", "--sensor", "microphone"), ["--sensor microphone", "--file"]),
        (("--program", "A", "--port", "x", "--pulses", "2"), ["--pulses 2", "--file"]),
        (("--program", "A", "--file", "none.csv", "--screen"), ["--screen", "--file"]),
    ],
)
def test_what_cannot_be_listened_to_is_rejected_in_a_sentence(
    shop: Shop, arguments: tuple[object, ...], said: list[str]
) -> None:
    result = run(shop, *arguments)
    assert result.exit_code != 0
    assert [fact for fact in said if fact not in str(result.exception)] == []


def test_what_the_tap_tests_predict_at_this_depth_stands_next_to_it(shop: Shop, tmp_path: Path) -> None:
    shop.run(("A", 12077, 1.5), more='feed = "x"')
    shop.tap_both()
    logbook = Logbook.open(shop.path)
    (verdict,), sound = logbook.verdicts(), read_cut_recording(recording(tmp_path / "cut.csv", 1712.3))
    below, above = (
        compare_cuts(logbook, find_cut_setting(logbook.machine, "A", None, 1e3 * share * verdict.limit), sound)[0]
        for share in (0.99, 1.01)
    )
    assert below.predicted is not None
    assert above.predicted is not None
    assert (below.predicted.stable, above.predicted.stable) == (True, False)
    assert above.predicted.frequency == pytest.approx(verdict.chatter_frequency, rel=2e-3)
    turned = [(above.predicted.frequency - sign * 1712.3) % above.tooth_passing_frequency for sign in (1, -1)]
    apart = min(min(one, above.tooth_passing_frequency - one) for one in turned)
    assert above.frequency_difference == pytest.approx(apart, abs=0.2)
