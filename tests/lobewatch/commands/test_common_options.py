"""python -m lobewatch, help COMMAND, --quiet, --verbose and progress."""

from __future__ import annotations

import re
import subprocess
import sys
from collections.abc import Callable
from datetime import UTC, datetime, timedelta, timezone
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
from typer import BadParameter

from lobewatch.commands.shared_options import local_time, present_time, rpm
from lobewatch.commands.verbosity import apply_verbosity
from lobewatch.show.terminal.output import notes
from lobewatch.step_times import STEP_TIMES, time_step
from tests.lobewatch.commands.conftest import Run
from tests.lobewatch.commands.pty_talk import Terminal

Shop = Any
"""Machine fixture of tests/lobewatch/conftest.py."""
QUIET = ("-q", "--quiet")
VERBOSE = ("-v", "--verbose")


def test_python_m_lobewatch_is_the_command_line(tmp_path: Path) -> None:
    command = [sys.executable, "-m", "lobewatch"]
    done = subprocess.run([*command, "--version"], cwd=tmp_path, capture_output=True, text=True, check=True)
    assert re.fullmatch(r"lobewatch \d+\.\d+\.\d+\n", done.stdout)
    assert subprocess.run([*command, "chek"], cwd=tmp_path, capture_output=True, check=False).returncode == 2


@pytest.mark.parametrize("words", [(), ("check",), ("emulate",), ("emulate", "taps")])
def test_help_of_a_command_is_its_help_page(run: Run, words: tuple[str, ...]) -> None:
    page = run(*words, "--help")
    assert (page.code, page.err) == (0, "")
    assert run("help", *words) == page
    assert run("-q", "help", *words) == page


@pytest.mark.parametrize("words", [("chek",), ("emulate", "nothing")])
def test_help_of_an_unknown_command_is_an_error(run: Run, words: tuple[str, ...]) -> None:
    said = run("help", *words)
    assert (said.code, said.out) == (2, "")
    assert f"'{words[-1]}'" in said.err


@pytest.mark.parametrize("option", QUIET)
def test_quiet_leaves_result_and_errors(run: Run, shop: Shop, option: str) -> None:
    place = (shop.path, "--program", "A", "--speed", "12900", "--depth", "1")
    loud = run("observe", *place, "--stable")
    assert loud.err.startswith("note: ")
    for words in ((option, "observe", *place, "--stable"), ("observe", *place, "--stable", option)):
        said = run(*words)
        assert (said.code, said.err) == (0, "")
        assert said.out.startswith("saved ")
    assert run("observe", *place, "--stable").err == loud.err
    failed = run("check", "nowhere", option)
    assert (failed.code, failed.out) == (2, "")
    assert failed.err.startswith("error: nowhere: ")


@pytest.mark.parametrize(("name", "is_quiet"), [("check", True), ("tap", False), ("listen", False), ("sensors", False)])
@pytest.mark.parametrize("is_before", [True, False])
def test_quiet_keeps_the_instructions_of_guided_commands(name: str, is_quiet: bool, is_before: bool) -> None:
    closes = list[Callable[[], None]]()
    named = {"invoked_subcommand": name, "info_name": "lobewatch"} if is_before else {"info_name": name}
    ctx = SimpleNamespace(**{"invoked_subcommand": None} | named, call_on_close=closes.append)
    apply_verbosity(ctx, quiet=True, verbose=False)
    assert notes.quiet is is_quiet
    for close in closes:
        close()
    assert notes.quiet is False


@pytest.mark.parametrize("option", VERBOSE)
def test_verbose_times_the_steps(run: Run, shop: Shop, no_search: None, option: str) -> None:
    shop.tap_both()
    (shop.path / "history.rows").unlink(missing_ok=True)
    said = run("check", shop.path, "--json", option)
    steps = dict(re.findall(r"(\w+) (\d+\.\d\d) s", said.err))
    assert said.err.count("\n") == 1
    assert steps.keys() == {"reading", "fitting", "verdicts", "other", "total"}
    parts = [float(value) for step, value in steps.items() if step != "total"]
    assert float(steps["total"]) == pytest.approx(sum(parts), abs=0.03)
    plain = run("check", shop.path, "--json")
    assert plain == said._replace(err="")
    before = run(option, "check", shop.path, "--json")
    assert (before.out, before.err.count("time: ")) == (plain.out, 1)
    assert run("-q", "check", shop.path, "--json", option) == plain


def test_a_step_does_not_count_the_steps_inside_it(monkeypatch: pytest.MonkeyPatch) -> None:
    clock = iter([0.0, 1.0, 3.0, 4.0, 10.0, 17.0])
    monkeypatch.setattr("lobewatch.step_times.time.perf_counter", lambda: next(clock))
    monkeypatch.setattr(STEP_TIMES, "seconds", {})
    with time_step("outer"), time_step("inner"):
        pass
    with time_step("inner"):
        pass
    assert STEP_TIMES.seconds == {"outer": 2.0, "inner": 9.0}


@pytest.mark.parametrize(
    ("words", "shown"),
    [
        (("check", "m"), "checking programs"),
        (("recommend", "m"), "searching stable speeds"),
        (("demo", "--taps", "2", "--out", "{}"), "tap tests"),
    ],
)
def test_progress_is_shown_on_a_terminal_only(
    run: Run, shop: Shop, tmp_path: Path, words: tuple[str, ...], shown: str
) -> None:
    shop.tap_both()
    assert run(*(word.format("piped") for word in words)).err == ""
    for name, quiet in (("loud", ()), ("quiet", ("-q",))):
        with Terminal(tmp_path, *quiet, *(word.format(name) for word in words)) as person:
            person.end()
        assert (shown in person.text) is not bool(quiet)


@pytest.mark.parametrize(
    ("text", "speed"),
    [("9000", 9000), ("8,000 rpm", 8000), ("18'000", 18000), ("18 000", 18000), ("1,000", 1000), ("318.310", 318.31)],
)
def test_a_speed_may_have_separators_of_thousands(text: str, speed: float) -> None:
    assert rpm(text) == speed


@pytest.mark.parametrize(
    ("text", "facts"), [("18,000", "18 or 18000"), ("18.000", "18 or 18000"), ("8000,5", "8000.5"), ("300 sfm", "rpm")]
)
def test_a_speed_of_two_values_is_rejected(text: str, facts: str) -> None:
    with pytest.raises(BadParameter, match=f"'{text}'.*{facts}"):
        rpm(text)


@pytest.mark.parametrize("text", ["2026-03-01T23:30Z", "2026-03-02 05:00+05:30", "2026-03-01T18:30:00-05:00"])
def test_the_present_time_may_have_a_time_zone(text: str) -> None:
    assert present_time(text) == datetime(2026, 3, 1, 23, 30, tzinfo=UTC)


@pytest.mark.parametrize("text", ["2026-03-02", "2026-03-02T08:30", "1970-01-01", "2199-12-31"])
def test_the_present_time_without_a_zone_is_local(text: str) -> None:
    assert present_time(text) == datetime.fromisoformat(text).astimezone()


@pytest.mark.parametrize("text", ["2026-11-01T10:00", "2026-11-01 10:00:00", "20261101T1000"])
def test_a_local_time_needs_no_seconds(text: str) -> None:
    assert local_time(text) == datetime(2026, 11, 1, 10)  # noqa: DTZ001 (local time)
    for offset in (5, -8):
        zone = timezone(timedelta(hours=offset))
        moment = datetime(2026, 11, 1, 10, tzinfo=zone).astimezone().replace(tzinfo=None)
        assert local_time(f"{text}{offset:+03d}:00") == moment


@pytest.mark.parametrize(
    "text", ["0001-01-01", "0001-01-01T00:00+14:00", "1969-12-31", "2200-01-01", "9999-12-31", "2026-13-01", "soon", ""]
)
def test_other_present_times_are_rejected_with_the_range(text: str) -> None:
    with pytest.raises(BadParameter, match="1970-01-01 to 2199-12-31"):
        present_time(text)
