"""Test tables of verdicts: the four words, and no number cut off in a narrow terminal."""

from __future__ import annotations

import io
import math
import re
from dataclasses import replace
from types import SimpleNamespace

import pytest
from hypothesis import given
from hypothesis import strategies as st

from lobewatch.machine import ProgramTable
from lobewatch.show.programs.advice import format_rpm
from lobewatch.show.programs.verdicts import (
    VERDICT_STYLES,
    chance_text,
    chatter_risk_text,
    is_safe,
    limits_text,
    verdict_json,
    verdict_table,
    verdict_text,
)
from lobewatch.show.terminal.option_names import with_option_names
from lobewatch.show.terminal.output import SafeConsole, emit
from lobewatch.verdicts import Stability, Verdict

pytestmark = pytest.mark.quick


def program(name: str = "A", speed: float = 12900.0, depth: float = 2.0) -> ProgramTable:
    return ProgramTable(
        name=name,
        speed_rpm=speed,
        depth_mm=depth,
        teeth=2,
        radial_depth_mm=5,
        tool_diameter_mm=10,
        direction="up",
        material="any",
    )


def a_verdict(
    word: Stability = Stability.STABLE,
    limit: float = 3e-3,
    low: float = 2e-3,
    high: float = 4e-3,
    chance: float = 0.1,
    **more: float,
) -> Verdict:
    return Verdict(program(), word, limit=limit, limit_low=low, limit_high=high, chatter_risk=chance, **more)  # type: ignore[arg-type]


def printed(*verdicts: Verdict, width: int = 80) -> list[str]:
    to = io.StringIO()
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("COLUMNS", str(width))
        patch.setattr(
            "lobewatch.show.terminal.output.results", SafeConsole(file=to, width=max(width, 120), soft_wrap=True)
        )
        emit({}, False, verdict_table(verdicts, ["> 20 %"] * len(verdicts)))
    return [line.rstrip() for line in to.getvalue().splitlines()]


def test_there_is_one_table_of_words() -> None:
    assert list(VERDICT_STYLES) == list(Stability)
    assert [str(word) for word in VERDICT_STYLES] == ["stable", "doubtful", "not stable", "unknown"]
    assert len({look.symbol for look in VERDICT_STYLES.values()}) == 4


@pytest.mark.parametrize("width", [40, 80, 200])
@given(
    name=st.text(st.characters(categories=["L", "N", "Zs", "P"]), min_size=1, max_size=90),
    speed=st.floats(100, 240_000),
    depth=st.floats(0.05, 300),
    limit=st.one_of(st.floats(1e-5, 2.0), st.just(math.inf)),
    spread=st.floats(1.05, 3),
    word=st.sampled_from(list(Stability)),
)
def test_no_number_of_a_table_is_cut(
    width: int, name: str, speed: float, depth: float, limit: float, spread: float, word: Stability
) -> None:
    verdict = Verdict(
        program(name, speed, depth),
        word,
        limit=limit,
        limit_low=min(limit, 2.0) / spread,
        limit_high=limit * spread,
        chatter_risk=0.004,
    )
    lines = printed(verdict, width=width)
    numbers = (f"{speed:g}", f"{depth:g}", limits_text(verdict), "< 1 %", "> 20 %")
    assert re.search(" +".join(map(re.escape, numbers)), "\n".join(lines)), lines
    assert max(map(len, lines)) <= max(width, 94)
    assert "…" not in "".join(lines) or "…" in name
    if width >= 200:
        assert "".join(with_option_names(name).split()) in "".join("".join(lines).split())


def test_long_names_and_large_numbers_fit_80_columns() -> None:
    name = "bracket 4711, roughing, slot with the long end mill, left side, 2nd clamping"
    large = Verdict(
        program(name, 120000.0, 123.45),
        Stability.NOT_STABLE,
        limit=0.0987654,
        limit_low=0.0543211,
        limit_high=math.inf,
        chatter_risk=0.999,
    )
    lines = printed(large, a_verdict())
    assert max(map(len, lines)) <= 80
    row = next(line for line in lines if "120000" in line)
    assert re.search(r"120000 +123\.45 +98\.77 \(54\.32\.\.> 2469\) +> 99 % +> 20 % +not stable$", row), row
    wrapped = " ".join(line[: lines[0].index("speed") - 1].strip() for line in lines[2:])
    assert re.sub(r"\s", "", name) in re.sub(r"\s", "", wrapped)


@pytest.mark.parametrize(
    ("verdict", "text"),
    [
        (a_verdict(), "3.00 (2.00..4.00)"),
        (a_verdict(limit=0.12345, low=0.1, high=1.23456), "123.5 (100.0..1235)"),
        (a_verdict(limit=math.inf, low=30e-3, high=math.inf), "> 40.00 (30.00..> 40.00)"),
        (a_verdict(limit=math.inf, low=math.inf, high=math.inf), "> 40.00"),
        (a_verdict(Stability.UNKNOWN, math.nan, math.nan, math.nan), "-"),
    ],
)
def test_limits_with_their_band(verdict: Verdict, text: str) -> None:
    assert limits_text(verdict) == text


@pytest.mark.parametrize(
    ("chance", "text"), [(0.0, "< 1 %"), (0.004, "< 1 %"), (0.18, "18 %"), (1.0, "> 99 %"), (math.nan, "-")]
)
def test_chance_of_chatter_once_it_turns(chance: float, text: str) -> None:
    assert chatter_risk_text(a_verdict(chance=chance)) == text


def test_a_verdict_says_what_it_must_in_the_same_breath() -> None:
    beyond = a_verdict(drive_limit=1e-3)
    assert verdict_text(beyond) == "stable, beyond the drive"  # by sound, without a tap test
    predicted = replace(beyond, assembly=SimpleNamespace(predicted=True))  # type: ignore[arg-type]
    assert verdict_text(predicted) == "stable, beyond the drive (predicted)"
    assert [
        is_safe(verdict)
        for verdict in (a_verdict(), beyond, a_verdict(Stability.DOUBTFUL), a_verdict(Stability.UNKNOWN))
    ] == [True] + [False] * 3
    assert verdict_text(a_verdict(Stability.UNKNOWN)) == "unknown"


def test_json_of_what_is_not_known() -> None:
    payload = verdict_json(Verdict(program(), Stability.UNKNOWN))
    assert (payload["stable"], payload["verdict"], payload["decided_by"], payload["doubt"], payload["cuts"]) == (
        None,
        "unknown",
        None,
        None,
        0,
    )
    assert all(math.isnan(payload[key]) for key in ("limit_mm", "limit_low_mm", "limit_high_mm", "chance_turning"))


def test_speeds_are_read_in_groups() -> None:
    assert [format_rpm(speed) for speed in (950.0, 12640.0, 12640.5, 123456.0)] == [
        "950",
        "12 640",
        "12 640.5",
        "123 456",
    ]


def test_json_says_limits_in_millimetres_and_angles_in_degrees() -> None:
    verdict = a_verdict(Stability.DOUBTFUL, drive_limit=7e-3, feed_angle=math.pi / 2, chatter_frequency=1700.0)
    said = verdict_json(verdict)
    limits = [said[name] for name in ("limit_mm", "limit_low_mm", "limit_high_mm", "drive_limit_mm")]
    assert limits == pytest.approx([3.0, 2.0, 4.0, 7.0])
    assert said["depth_margin"] == pytest.approx(3.0 / 2.0 - 1)
    assert (said["worst_feed_deg"], said["chatter_frequency_hz"]) == (pytest.approx(90.0), 1700.0)


CHANCES = [math.nan, 0.0, 0.0099, 0.01, 0.02, 0.1, 0.5, 0.51, 0.54, 0.55, 0.6, 0.9, 0.9499, 0.95, 1.0]


def test_a_chance_in_words_is_near_the_chance() -> None:
    texts = [chance_text(chance) for chance in CHANCES]
    assert texts[:2] == ["unknown", "less than 1 in 100"]
    assert texts[2] == texts[1]
    assert texts[-2:] == ["almost certain"] * 2
    for chance, text in list(zip(CHANCES, texts, strict=True))[3:-2]:
        shown, total = map(int, re.findall(r"\d+", text))
        assert 0 < shown < total
        assert shown / total == pytest.approx(chance, abs=0.0501)


@given(st.floats(0.01, 0.9499))
def test_no_chance_in_words_is_a_quarter_off(chance: float) -> None:
    shown, total = map(int, re.findall(r"\d+", chance_text(chance)))
    assert 0.7 <= shown / total / chance <= 1.4
