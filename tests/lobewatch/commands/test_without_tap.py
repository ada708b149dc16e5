"""`listen FILE` without a machine, and `listen`, `suggest` and `check` on a machine without a tap test."""

from __future__ import annotations

import json
from dataclasses import replace
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import scipy.io.wavfile
from typer.testing import CliRunner, Result

from lobewatch.cli import app
from lobewatch.logbook import Logbook
from lobewatch.machine.folder_updates import add_event
from lobewatch.machine.journal.entries import PartVerdict
from lobewatch.show.history import cut_json, cut_result_text
from lobewatch.show.terminal.option_names import with_option_names

Shop = Any
"""Machine fixture of tests/lobewatch/conftest.py."""
RATE, RPM, CHATTER = 12800, 18000.0, 1370.0


def sound(path: Path, chatter: float | None = CHATTER, *, flutes: int = 2, tone: float = 0.0) -> Path:
    """Write a sound file of nothing but a cut: 1.5 s without air."""
    random, time = np.random.default_rng(0), np.arange(round(1.5 * RATE)) / RATE
    tooth = flutes * RPM / 60
    lines = [(tooth * k, 20.0 / k) for k in range(1, 10)] + [(tone, 3.0 * bool(tone))]
    if chatter is not None:
        lines += [(chatter + k * tooth, 30.0 * 0.3 ** abs(k)) for k in range(-1, 4)]
    signal = random.normal(scale=0.05, size=time.size)
    signal += sum(size * np.sin(2 * np.pi * f * time + random.uniform(0, 6)) for f, size in lines)
    scipy.io.wavfile.write(path, RATE, (signal / 200).astype(np.float32))
    return path


def passes(folder: Path, chatters: list[float | None], *, tone: float = 0.0) -> Path:
    """Write a sound file of several cuts with air, and a tone throughout if it is given (Hz)."""
    cuts = [scipy.io.wavfile.read(sound(folder / "part.wav", chatter))[1] for chatter in chatters]
    silence = np.random.default_rng(1).normal(scale=2e-4, size=RATE)
    signal = np.concatenate([silence, *(part for cut in cuts for part in (cut, silence))])
    signal += 3.0 / 200 * bool(tone) * np.sin(2 * np.pi * tone * np.arange(signal.size) / RATE)
    scipy.io.wavfile.write(folder / "passes.wav", RATE, signal.astype(np.float32))
    return folder / "passes.wav"


def run(*arguments: object) -> Result:
    result = CliRunner().invoke(app, [*map(str, arguments)])
    if isinstance(result.exception, ValueError | OSError):
        result.exception.args = (with_option_names(str(result.exception)),)
    return result


@pytest.fixture
def untapped(shop: Shop) -> Shop:
    """Machine with program A of two flutes at 18 000 rpm, 1 mm."""
    shop.run(("A", RPM, 1.0), more='feed = "x"')
    shop.edit("teeth = 4", "teeth = 2")
    return shop


def check(shop: Shop, *arguments: object) -> dict[str, Any]:
    result = run("check", shop.path, "--json", *arguments)
    (program,) = json.loads(result.stdout)["programs"]
    assert result.exit_code == (0 if program["verdict"] == "stable" else 1)
    return dict(program)


def test_a_file_without_a_machine_gives_chatter_and_the_next_speeds(tmp_path: Path) -> None:
    file, picture = sound(tmp_path / "cut.wav"), tmp_path / "cut.svg"
    arguments = ("listen", file, "--teeth", 2, "--speed", RPM)
    told = json.loads(run(*arguments, "--speeds", "8000 24000", "--depth", 1, "--out", picture, "--json").stdout)
    assert (told["word"], told["next_reason"], told["range_rpm"]) == ("chatter", "", [8000, 24000])
    assert told["chatter_frequency_hz"] == pytest.approx(CHATTER, abs=0.2)
    assert [speed["lobe"] for speed in told["next_speeds"]] == [2, 3, 4]
    assert told["next_speeds"][0]["speed_rpm"] == pytest.approx(60 * CHATTER / 4, rel=0.025)
    assert told["next_speeds"][0]["depth_mm"] == 1.0
    assert "chatter at 1370" in picture.read_text("utf-8")
    unknown = json.loads(run(*arguments, "--json").stdout)
    assert unknown["range_rpm"] == [0.5 * RPM, 1.5 * RPM]
    assert unknown["next_speeds"][0]["depth_mm"] is None
    assert run(*arguments).exit_code == 0


@pytest.mark.parametrize("speeds", ["5,000 24,000", "5000-24000", "5000..24000 rpm"])
def test_speeds_are_read_like_those_of_a_machine(tmp_path: Path, speeds: str) -> None:
    arguments = ("listen", sound(tmp_path / "cut.wav"), "--teeth", 2, "--speed", RPM, "--speeds", speeds, "--json")
    assert json.loads(run(*arguments).stdout)["range_rpm"] == [5000, 24000]


def test_air_is_missed_only_where_it_matters(tmp_path: Path) -> None:
    arguments = ("--teeth", 2, "--speed", RPM, "--json")
    stable = json.loads(run("listen", sound(tmp_path / "a.wav", None), *arguments).stdout)
    assert (stable["word"], stable["next_reason"]) == ("stable", "stable")
    tone = json.loads(run("listen", sound(tmp_path / "b.wav", None, tone=1234.0), *arguments).stdout)
    assert (tone["word"], tone["reason"], tone["next_reason"]) == ("cannot tell", "no-air", "no-verdict")


def test_an_overloaded_sound_names_no_accelerometer_and_no_next_speed(tmp_path: Path) -> None:
    rate, values = scipy.io.wavfile.read(sound(tmp_path / "cut.wav"))
    scipy.io.wavfile.write(tmp_path / "cut.wav", rate, np.clip(20 * values, -1, 1))
    arguments = ("listen", tmp_path / "cut.wav", "--teeth", 2, "--speed", RPM)
    told = json.loads(run(*arguments, "--json").stdout)
    assert (told["word"], told["reason"], told["next_reason"]) == ("cannot tell", "overload", "no-verdict")
    assert "accelerometer" not in run(*arguments).stdout


def test_a_motion_needs_no_sensor_option(tmp_path: Path) -> None:
    rate, values = scipy.io.wavfile.read(sound(tmp_path / "cut.wav"))
    rows = "\n".join(f"{n / rate:.7f},{200 * value:.4f}" for n, value in enumerate(values))
    for heading, sensor in (("acceleration [m/s^2]", "accelerometer"), ("ch1", "microphone")):
        (tmp_path / "cut.csv").write_text(f"time [s],{heading}\n{rows}\n")
        told = json.loads(run("listen", tmp_path / "cut.csv", "--teeth", 2, "--speed", RPM, "--json").stdout)
        assert (told["word"], told["sensor"]) == ("chatter", sensor)


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (("--speed", RPM), ["--teeth"]),
        (("--teeth", 2), ["--speed"]),
        (("--teeth", 2, "--speed", 0), ["--speed 0", "above 0"]),
        (("--teeth", 0, "--speed", RPM), ["--teeth 0", "above 0"]),
        (("--teeth", 2, "--speed", RPM, "--depth", -1), ["--depth -1", "above 0"]),
        (("--teeth", 2, "--speed", RPM, "--speeds", "8000"), ["--speeds '8000'"]),
        (("--teeth", 2, "--speed", RPM, "--speeds", "9000 8000"), ["--speeds '9000 8000'"]),
        (("--teeth", 2, "--speed", RPM, "--speeds", "8000 9000"), ["--speed 18000", "--speeds 8000..9000"]),
        (("--teeth", 2, "--speed", RPM, "--program", "A"), ["--program", "machine folder"]),
    ],
)
def test_a_bad_request_is_one_sentence(tmp_path: Path, arguments: tuple[object, ...], said: list[str]) -> None:
    file = tmp_path / "cut.wav"
    file.write_bytes(b"")
    result = run("listen", file, *arguments)
    assert result.exit_code != 0
    assert [fact for fact in said if fact not in str(result.exception)] == []


def test_a_missing_file_is_named_and_a_folder_takes_no_flutes(untapped: Shop, tmp_path: Path) -> None:
    assert "none.wav" in str(run("listen", tmp_path / "none.wav", "--teeth", 2, "--speed", RPM).exception)
    assert "--teeth" in str(run("listen", untapped.path, "--program", "A", "--teeth", 2).exception)


@pytest.mark.parametrize(
    ("arguments", "rejected"),
    [
        (("cut.wav", "--seconds", 5), "--seconds"),
        (("cut.wav", "--cuts", 3), "--cuts"),
        (("cut.wav", "--sensor", "accelerometer"), "--sensor"),
        (("--page", "--teeth", 4), "--teeth"),
        (("--page", "--out", "a.png"), "--out"),
        (("--page", "--dry-run"), "--dry-run"),
        (("--page", "cut.wav"), "MACHINE"),
        (("folder", "--rate", 5000), "--rate"),
        (("folder", "--http-port", 8080), "--http-port"),
        (("folder", "--file", "cut.wav", "--seconds", 120), "--seconds"),
        (("nosuch", "--teeth", 4), "nosuch: no such file or folder"),
    ],
)
def test_an_option_that_does_not_apply_is_rejected(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, arguments: tuple[object, ...], rejected: str
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("folder").mkdir()
    Path("cut.wav").touch()
    error = run("listen", *arguments).exception
    assert isinstance(error, ValueError)
    assert str(error).startswith(rejected)


def test_cuts_are_kept_until_one_is_stable(untapped: Shop, tmp_path: Path) -> None:
    start = json.loads(run("suggest", untapped.path, "--program", "A", "--json").stdout)
    assert (start["suggested"], start["next_reason"]) == ({"speed_rpm": RPM, "depth_mm": 1.0}, "no-verdict")
    file = sound(tmp_path / "cut.wav")
    dry, kept = (
        json.loads(run("listen", untapped.path, *arguments, "--json").stdout)
        for common in [("--program", "A", "--file", file, "--sensor", "microphone")]
        for arguments in [(*common, "--dry-run"), common]
    )
    assert (kept["word"], kept["id"], kept["next_reason"]) == ("chatter", "c1", "")
    assert dry["next_speeds"] == kept["next_speeds"]
    following = json.loads(run("suggest", untapped.path, "--program", "A", "--json").stdout)
    best = following["suggested"]
    assert following["next_speeds"] == kept["next_speeds"]
    assert best["speed_rpm"] == kept["next_speeds"][0]["speed_rpm"]
    place = ("--program", "A", "--speed", best["speed_rpm"], "--depth", best["depth_mm"])
    assert run("observe", untapped.path, *place, "--stable").exit_code == 0
    done = json.loads(run("suggest", untapped.path, "--program", "A", "--json").stdout)
    assert (done["suggested"], done["next_reason"], done["next_speeds"]) == (None, "stable", [])
    assert run("suggest", untapped.path, "--program", "A").exit_code == 0


def test_without_a_tap_test_only_the_cut_at_that_speed_decides(untapped: Shop) -> None:
    program = check(untapped)
    assert (program["verdict"], program["decided_by"]) == ("doubtful", "no-tap-test")
    assert (program["limit_mm"], program["stable"]) == (None, None)
    (remark,) = program["remarks"]
    assert remark["code"] == "no-tap-test"
    assert "_" not in remark["text"] + remark["cure"]  # no name of the library
    assert "lobewatch listen" in remark["cure"]
    assert run("observe", untapped.path, "--program", "A", "--depth", 1.2, "--stable").exit_code == 0
    assert (check(untapped)["verdict"], check(untapped)["decided_by"]) == ("stable", None)
    for value in (("--depth", 1.3), ("--speed", 18100, "--depth", 1), ("--direction", "up"), ("--radial", 15)):
        given = dict(zip(("--speed", "--depth"), (RPM, 1.0), strict=True)) | {str(value[0]): value[1]}
        given |= dict(zip(map(str, value[::2]), value[1::2], strict=True))
        asked = [word for pair in given.items() for word in pair]
        assert check(untapped, *asked)["verdict"] == "doubtful", value
    assert run("observe", untapped.path, "--program", "A", "--speed", 18100, "--chatter").exit_code == 0
    assert check(untapped)["verdict"] == "not stable"
    assert run("exclude", untapped.path, "c2", "--reason", "x").exit_code == 0
    assert check(untapped)["verdict"] == "stable"
    add_event(untapped.folder, "new bearings", datetime.now(UTC) + timedelta(seconds=1), new_baseline=True)
    assert check(untapped)["verdict"] == "doubtful"


@pytest.mark.parametrize("more", ["feed_per_tooth_mm = 0.1", "thin = true", "corner_radius_mm = 11", 'wear = "worn"'])
def test_a_cut_of_another_kind_proves_nothing(untapped: Shop, more: str) -> None:
    assert run("observe", untapped.path, "--program", "A", "--stable").exit_code == 0
    untapped.edit('name = "A"', f'name = "B"\n{more}')
    assert check(untapped)["verdict"] == "doubtful"


def test_a_cut_with_other_coefficients_proves_nothing(untapped: Shop) -> None:
    assert run("observe", untapped.path, "--program", "A", "--stable").exit_code == 0
    assert check(untapped)["verdict"] == "stable"
    untapped.edit("tangential_n_per_mm2 = 1400", "tangential_n_per_mm2 = 2500")
    assert check(untapped)["verdict"] == "doubtful"
    after = json.loads(run("suggest", untapped.path, "--program", "A", "--json").stdout)
    assert after["next_reason"] == "no-verdict"


def test_a_stable_cut_after_chatter_leaves_the_program_doubtful(untapped: Shop) -> None:
    for word in ("--chatter", "--stable"):
        assert run("observe", untapped.path, "--program", "A", word).exit_code == 0
    program = check(untapped)
    assert (program["verdict"], program["decided_by"]) == ("doubtful", "no-tap-test")
    assert [remark["code"] for remark in program["remarks"]] == ["no-tap-test", "cuts-contradict"]
    assert run("exclude", untapped.path, "c1", "--reason", "x").exit_code == 0
    assert check(untapped)["verdict"] == "stable"


@pytest.mark.parametrize("chatters", [[CHATTER, None], [None, CHATTER]])
def test_the_worst_pass_decides_on_a_recording(untapped: Shop, tmp_path: Path, chatters: list[float | None]) -> None:
    file = passes(tmp_path, chatters)
    told = json.loads(run("listen", file, "--teeth", 2, "--speed", RPM, "--json").stdout)
    assert sorted(cut["word"] for cut in told["cuts"]) == ["chatter", "stable"]
    assert (told["word"], told["next_reason"], told["contradicting_rpm"]) == ("chatter", "", [])
    arguments = ("--program", "A", "--file", file, "--sensor", "microphone", "--json")
    stored = json.loads(run("listen", untapped.path, *arguments).stdout)
    assert (stored["next_reason"], stored["contradicting_rpm"]) == ("", [])
    assert check(untapped)["verdict"] == "not stable"


def test_air_of_an_earlier_cut_serves_a_tool_without_a_tap_test(untapped: Shop, tmp_path: Path) -> None:
    tone, common = 1234.0, ("--program", "A", "--sensor", "microphone", "--json")
    alone = sound(tmp_path / "alone.wav", None, tone=tone)
    missed = json.loads(run("listen", untapped.path, *common, "--file", alone, "--dry-run").stdout)
    assert (missed["word"], missed["reason"]) == ("cannot tell", "no-air")
    first = json.loads(run("listen", untapped.path, *common, "--file", passes(tmp_path, [None], tone=tone)).stdout)
    assert (first["word"], first["air_from"]) == ("stable", None)
    again = json.loads(run("listen", untapped.path, *common, "--file", alone, "--dry-run").stdout)
    assert (again["word"], again["air_from"]) == ("stable", first["id"])


def test_a_cut_without_a_verdict_is_named_by_check_until_it_is_excluded(untapped: Shop, tmp_path: Path) -> None:
    silence = tmp_path / "silence.wav"
    scipy.io.wavfile.write(silence, RATE, np.zeros(2 * RATE, np.float32))
    run("listen", untapped.path, "--program", "A", "--file", silence, "--sensor", "microphone")
    told = {remark["code"]: remark["text"] for remark in check(untapped)["remarks"]}
    assert "c1 (no-cut)" in told["cuts-without-verdict"]
    run("exclude", untapped.path, "c1", "--reason", "silence")
    assert "cuts-without-verdict" not in {remark["code"] for remark in check(untapped)["remarks"]}


def test_the_history_shows_the_parts_of_a_cut_with_times(untapped: Shop, tmp_path: Path) -> None:
    run("listen", untapped.path, "--program", "A", "--file", passes(tmp_path, [CHATTER]), "--sensor", "microphone")
    cut = Logbook.open(untapped.path).files.contents.cuts[-1]
    (part,) = cut_json(cut)["parts"]
    assert (part["verdict"], part["hz"]) == ("chatter", pytest.approx(CHATTER, abs=1.0))
    assert 0.5 < part["from_s"] < part["to_s"] < 3.5
    two = replace(cut, parts=(PartVerdict(0.0, 1.6, "stable"), PartVerdict(1.6, 4.6, "chatter", 1760.0)))
    assert all(time in cut_result_text(two) for time in ("0.0 to 1.6 s", "1.6 to 4.6 s"))
