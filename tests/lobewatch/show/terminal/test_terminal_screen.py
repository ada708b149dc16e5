"""Test the terminal screen and the lines for a log: words, symbols, keys and bells."""

from __future__ import annotations

import io
import os
import re
import threading
from collections.abc import Iterator
from dataclasses import replace

import pytest
from rich.console import Console

from acquisition import HitFlags
from lobewatch.show.terminal.terminal_screen import (
    CHOICE_KEYS,
    TapPrinter,
    TerminalScreen,
    normalize_keys,
    render_state,
)
from lobewatch.tap.start_questions import START_CHOICE, STILL_CHOICE
from lobewatch.tap.state import Check, Choice, ListedHit, Outcome, ProgramVerdict, TapState, TapStep

GOOD = ListedHit(1, HitFlags.OK, "231 N")
DOUBLE = ListedHit(
    2, HitFlags.DOUBLE_HIT, "310 N", reason="Second peak 12 ms after the first (18 %): let it bounce [back]."
)
STATE = TapState(
    1, TapStep.TAP, "mill-3, tool T1, direction x", device="TAPS, 25600 Hz", good=1, hits=(GOOD,), levels=(0.1, 2.0)
)


class Session:
    """Tap test that is moved on from outside, and counts its calls."""

    def __init__(self, state: TapState = STATE) -> None:
        self.state = state
        self.asked: list[str] = []
        self.called = threading.Event()

    def undo(self) -> None:
        self.asked.append("undo")
        self.called.set()

    def decide(self, number: int | None, *, accept: bool) -> None:
        self.asked.append(f"{'accept' if accept else 'reject'} {number}")
        self.called.set()

    def stop(self) -> None:
        self.asked.append("stop")
        self.called.set()

    def choose(self, key: str, tool: str = "") -> None:
        self.asked.append(f"choose {key} {tool}".strip())
        self.called.set()


def seen(state: TapState, width: int = 100, **options: bool) -> str:
    console = Console(file=io.StringIO(), width=width, force_terminal=True, **options)  # type: ignore[arg-type]
    console.print(render_state(state, muted=False))
    text = console.file.getvalue()  # type: ignore[attr-defined]
    return str(text)


def plain(state: TapState, width: int = 100) -> str:
    return re.sub(r"\x1b\[[0-9;]*m", "", seen(state, width))


CHOICES = Choice("y", "tap y"), Choice("tool", "next tool"), Choice("done", "done")
KEYS = "y tap y   n next tool   q done   m mute"
SYMBOLS = dict(zip(TapStep, ("?", "…", "▼", "…", "✓", "✗", "!", "⟳", "■", "✗"), strict=True))


@pytest.mark.parametrize("word", TapStep)
def test_every_verdict_has_a_symbol_and_how_far_it_is(word: TapStep) -> None:
    text = plain(replace(STATE, word=word, verdict="good" if word is TapStep.GOOD else "double hit"))
    shown = "DOUBLE HIT" if word is TapStep.REFUSED else str(word)
    assert f"{SYMBOLS[word]}  {shown}   1 / 10" in text
    assert "mill-3, tool T1, direction x - TAPS, 25600 Hz" in text
    assert "u undo   q stop   m mute" in text


def test_a_trial_hit_is_distinguished_from_a_good_one() -> None:
    assert "✓  GOOD (trial hit)   0 / 10" in plain(
        replace(STATE, word=TapStep.GOOD, verdict="good", trial=True, good=0, hits=())
    )


def test_what_was_wrong_and_how_far_the_mean_has_come() -> None:
    state = replace(STATE, hits=(GOOD, DOUBLE), reason=DOUBLE.reason, mean_change=0.0123, settled=True)
    text = plain(state)
    assert text.count(DOUBLE.reason) == 2
    assert "2     310 N  ✗ DOUBLE HIT  Second peak" in text
    assert "1     231 N  ✓ GOOD" in text
    assert re.search(r"0\.1 N rms.* 2 m/s\^2 rms.* 1\.2 %", text)
    undone = plain(replace(STATE, hits=(GOOD._replace(flags=HitFlags.UNDONE, undone=True),)))
    assert "↶ UNDONE" in undone


def test_a_long_reason_is_not_cut_off_on_a_narrow_terminal() -> None:
    text = " ".join(plain(replace(STATE, reason="a long reason " * 12 + "end"), width=50).split())
    assert text.count("a long reason") == 12
    assert "end" in text


def test_checks_before_the_first_hit_and_the_result_after_the_last() -> None:
    checks = (Check("disk", True, "78 GB free"), Check("hum", False, "1 N rms at 50 Hz"))
    text = plain(replace(STATE, hits=(), good=0, checks=checks))
    assert "✓ disk: 78 GB free" in text
    assert "✗ hum: 1 N rms at 50 Hz" in text
    later = plain(replace(STATE, checks=checks))
    assert "disk" not in later
    assert "✗ hum: 1 N rms at 50 Hz" in later
    words = [ProgramVerdict("slot (8000 rpm, 2 mm)", "stable")]
    outcome = Outcome("warn", ["f_n 1700 Hz."], "Tap again.", programs=words)
    done = plain(replace(STATE, word=TapStep.DONE, outcome=outcome, choices=CHOICES))
    lines = [line.strip() for line in done.splitlines() if line.strip()][-4:]
    assert lines == ["f_n 1700 Hz.", "slot (8000 rpm, 2 mm): stable", "! WARNING   next: Tap again.", KEYS]


@pytest.mark.parametrize(
    ("word", "keys", "chosen"),
    [
        (TapStep.MOVE, "y", ["choose y"]),
        (TapStep.MOVE, "\n", ["choose y"]),
        (TapStep.MOVE, "u", ["choose y"]),  # the foot switch
        (TapStep.DONE, "u", []),
        (TapStep.DONE, "q", ["choose done"]),
        (TapStep.DONE, "z", []),
        (TapStep.TAP, "u", ["undo"]),
    ],
)
def test_keys_between_two_tests_choose_what_comes_next(word: TapStep, keys: str, chosen: list[str]) -> None:
    session = Session(replace(STATE, word=word, choices=() if word is TapStep.TAP else CHOICES))
    screen, _ = screen_of(session)
    screen.handle_key(keys)
    assert session.asked == chosen


def test_colours_go_without_and_the_words_stay() -> None:
    colour = re.compile(r"\x1b\[[0-9;]*(?:[34]8;|3[0-7]|4[0-7])[0-9;]*m")
    assert colour.search(seen(STATE))
    without = seen(STATE, no_color=True)
    assert not colour.search(without)
    assert "▼  TAP" in without


@pytest.fixture
def terminal(monkeypatch: pytest.MonkeyPatch) -> Iterator[int]:
    """Return a keyboard whose text arrives at standard input."""
    pty = pytest.importorskip("pty")
    keyboard, end = pty.openpty()
    with os.fdopen(end, "r") as stdin:
        monkeypatch.setattr("sys.stdin", stdin)
        yield keyboard
    os.close(keyboard)


def screen_of(session: Session) -> tuple[TerminalScreen, io.StringIO]:
    file = io.StringIO()
    return TerminalScreen(session, Console(file=file, width=80, force_terminal=True)), file


@pytest.mark.parametrize(("key", "asked"), [(b"u", "undo"), (b"Q", "stop"), (b"\x1b[5~", "undo")])
def test_keys_reach_the_test(terminal: int, key: bytes, asked: str) -> None:
    session = Session()
    with screen_of(session)[0]:
        os.write(terminal, key)
        assert session.called.wait(60)
    assert session.asked == [asked]


def test_a_key_held_down_counts_once_and_arrows_for_nothing() -> None:
    session = Session()
    screen = screen_of(session)[0]
    for key in normalize_keys("uuuuu\x1bOq\x1b[1;5Q\x1b[A\xe0uU"):
        screen.handle_key(key)
    assert session.asked == ["undo"]


def test_undo_again_after_a_while(monkeypatch: pytest.MonkeyPatch) -> None:
    session = Session()
    screen = screen_of(session)[0]
    for now in (10.0, 10.4, 11.2, 12.0):
        monkeypatch.setattr("lobewatch.show.terminal.terminal_screen.time.monotonic", lambda now=now: now)
        screen.handle_key("u")
    assert session.asked == ["undo"] * 3


def test_the_terminal_is_left_as_it_was(terminal: int) -> None:
    termios = pytest.importorskip("termios")
    before = termios.tcgetattr(terminal)
    with screen_of(Session())[0]:
        assert termios.tcgetattr(terminal) != before
    assert termios.tcgetattr(terminal) == before


@pytest.mark.parametrize(
    ("word", "bells"), [(TapStep.GOOD, 1), (TapStep.REFUSED, 2), (TapStep.NO_DEVICE, 3), (TapStep.WAIT, 0)]
)
def test_each_verdict_has_its_number_of_bells_unless_muted(terminal: int, word: TapStep, bells: int) -> None:
    screen, file = screen_of(Session())
    screen.ring_bells(STATE, replace(STATE, word=word))
    assert file.getvalue().count("\a") == bells
    screen.handle_key("m")
    screen.ring_bells(STATE, replace(STATE, word=word))
    assert file.getvalue().count("\a") == bells


def test_lines_for_a_log_tell_everything_once() -> None:
    session = Session(replace(STATE, hits=(), device=""))
    console = Console(file=io.StringIO(), width=200)
    printer = TapPrinter(session, console)
    earlier = GOOD._replace(earlier=True)
    away = "the DAQ was unplugged; the test goes on at this hit"
    checks = (Check("hum", False, "1 N rms at 50 Hz"), Check("disk", True, "full of room"))
    states = (
        replace(STATE, hits=(earlier,), resumed="going on with the test begun today", checks=checks),
        replace(STATE, hits=(earlier, DOUBLE), checks=checks, resumed="going on with the test begun today"),
        replace(STATE, hits=(earlier, DOUBLE), word=TapStep.NO_DEVICE, reason=away, checks=checks, resumed="going on"),
    )
    for state in states:
        for _ in range(2):
            printer.print_new(state)
    log = console.file.getvalue()  # type: ignore[attr-defined]
    assert log.count("TAPS, 25600 Hz. ") == 1
    assert log.count("going on with the test begun today") == 1
    assert log.count("! hum: 1 N rms at 50 Hz") == 1
    assert "full of room" not in log
    assert log.count(" / 10") == 1
    assert "  1 / 10  ✗ DOUBLE HIT  Second peak 12 ms after the first (18 %): let it bounce [back].  (310 N)" in log
    assert log.count(away) == 1


def test_what_a_trial_hit_says_is_a_line_of_its_own_as_it_is_in_no_list() -> None:
    console = Console(file=io.StringIO(), width=200)
    printer = TapPrinter(Session(replace(STATE, hits=())), console)
    printer.print_new(
        replace(STATE, word=TapStep.REFUSED, verdict="double hit", trial=True, reason="Bounce back.", hits=())
    )
    printer.print_new(replace(STATE, word=TapStep.REFUSED, verdict="too soft", reason="Hit harder.", hits=(GOOD,)))
    log = console.file.getvalue()  # type: ignore[attr-defined]
    assert log.splitlines() == ["Bounce back.", "  1 / 10  ✓ GOOD  (231 N)"]


def test_a_log_has_the_checks_that_tell_something_though_all_is_well() -> None:
    console = Console(file=io.StringIO(), width=200)
    printer = TapPrinter(Session(), console)
    checks = Check("band", True, "modes up to 1280 Hz are heard", is_notable=True), Check("disk", True, "full of room")
    for _ in range(2):
        printer.print_new(replace(STATE, checks=checks, hits=()))
    assert console.file.getvalue().splitlines() == ["✓ band: modes up to 1280 Hz are heard"]  # type: ignore[attr-defined]


def test_a_verdict_ahead_of_its_hit_rings_once_and_the_next_hit_again(terminal: int) -> None:
    screen, file = screen_of(Session())
    word = replace(STATE, word=TapStep.GOOD)
    first = replace(word, hits=(*STATE.hits, GOOD))
    second = replace(first, hits=(*first.hits, GOOD))
    bells = []
    for before, state in ((STATE, word), (word, first), (first, second)):
        screen.ring_bells(before, state)
        bells.append(file.getvalue().count("\a"))
    assert bells == [1, 1, 2]


@pytest.mark.parametrize(
    ("typed", "asked"),
    [("a", "accept None"), ("r", "reject None"), ("3a", "accept 3"), ("12r", "reject 12"), ("3ma", "accept None")],
)
def test_keys_accept_and_reject_the_last_hit_or_the_one_whose_number_was_typed(typed: str, asked: str) -> None:
    session = Session()
    screen = TerminalScreen(session, Console(file=io.StringIO()))
    for key in typed:
        screen.handle_key(key)
    assert session.asked == [asked]


def test_an_accepted_hit_shows_its_faults_and_a_typed_number_is_shown() -> None:
    accepted = ListedHit(2, HitFlags.OK, "231 N", accepted=HitFlags.DOUBLE_HIT)
    assert "✓ ACCEPTED  double hit" in plain(replace(STATE, hits=(accepted,)))
    console = Console(file=io.StringIO(), width=100)
    console.print(render_state(STATE, muted=False, typed_number="12"))
    assert "hit 12" in console.file.getvalue()  # type: ignore[attr-defined]


def test_a_second_press_of_a_key_does_not_answer_the_next_question() -> None:
    session = Session(replace(STATE, word=TapStep.ASK, choices=(STILL_CHOICE,)))
    screen, _ = screen_of(session)
    for key in (CHOICE_KEYS[START_CHOICE.key], CHOICE_KEYS[STILL_CHOICE.key]):
        screen.handle_key(key)
    assert session.asked == [f"choose {STILL_CHOICE.key}"]
