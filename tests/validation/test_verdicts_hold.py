"""Truth and sharpness of the verdict `stable`; docs/studies/long-tests.md has the last figures."""

from __future__ import annotations

import math
import sys

import msgspec
import numpy as np
import pytest
from random_milling import random_case
from verdict_study import MACHINE, assembly, chattering, limit_mm, program, study, upper_limit

from lobes import count_pieces, growth_rate
from lobewatch.machine import ToolWear
from lobewatch.verdicts.monte_carlo import run_monte_carlo
from lobewatch.verdicts.program_case import ProgramCase, build_program
from lobewatch.verdicts.program_samples import build_median_row
from lobewatch.verdicts.uncertainty import WEAR_FACTORS, uncertainty_of
from lobewatch.verdicts.verdict import Stability, classify_stability, evaluate_program


def say(text: str) -> None:
    """Seen with pytest -rP or -s."""
    sys.stdout.write(f"{text}\n")


def share(number: int, of: int) -> str:
    return f"{number} of {of} (95 %: at most {upper_limit(number, of):.2%})"


def test_a_few_programs_called_stable_and_settings_recommended_do_not_chatter() -> None:
    counts = study(count=12, seed=2, truths=4, most_modes=3)
    assert counts.stable
    assert counts.recommended
    assert counts.refused == 0
    assert chattering(counts.stable + counts.recommended) == 0


@pytest.mark.long
@pytest.mark.timeout(14400)
def test_at_most_1_percent_of_what_is_called_stable_or_recommended_chatters() -> None:
    counts = study(count=200, seed=1, truths=4)
    stable, recommended = chattering(counts.stable), chattering(counts.recommended)
    say(f"{counts.stable_programs} programs called stable: {share(stable, len(counts.stable))} of their truths chatter")
    say(f"{counts.settings} settings, {counts.refused} refused: {share(recommended, len(counts.recommended))} chatter")
    assert min(len(counts.stable), len(counts.recommended)) >= 300
    assert upper_limit(stable, len(counts.stable)) <= 0.01
    assert upper_limit(recommended, len(counts.recommended)) <= 0.01
    assert counts.refused == 0


@pytest.mark.parametrize("count", [2, pytest.param(200, marks=[pytest.mark.long, pytest.mark.timeout(7200)])])
def test_a_machine_tapped_in_one_direction_is_never_called_stable(count: int) -> None:
    words = []
    for rng in np.random.default_rng(3).spawn(count):
        milling = random_case(rng)
        limit = limit_mm(milling)
        depth = 0.1 * limit if np.isfinite(limit) else 1.0
        words.append(evaluate_program(program(milling, depth), assembly(milling, ("x",)), MACHINE).stability)
    assert Stability.STABLE not in words
    assert Stability.DOUBTFUL in words


@pytest.mark.long
@pytest.mark.timeout(7200)
def test_what_is_stable_in_the_whole_uncertainty_with_5_percent_to_spare_is_called_stable() -> None:
    """2000 draws at 1.05 times the depth, by other random numbers."""
    called = []
    for rng in np.random.default_rng(4).spawn(120):
        milling = random_case(rng)
        limit = limit_mm(milling)
        if not np.isfinite(limit):
            continue
        table = program(milling, limit * rng.uniform(0.4, 0.85))
        tool, cut = assembly(milling), build_program(table, MACHINE)
        truths = uncertainty_of(tool, table, MACHINE).sample(build_median_row(cut, tool), 2000, seed=99)
        depths = np.full((2000, 1), 1.05 * cut.depth)
        turned = [truths.with_cut(way) for way in ProgramCase(table, tool, MACHINE).cuts]
        if all(np.all(growth_rate(rows, depths, count_pieces(rows, 1.05 * cut.depth)) < 0) for rows in turned):
            called.append(evaluate_program(table, tool, MACHINE).stability is Stability.STABLE)
    say(f"{share(sum(called), len(called))} called stable")
    assert len(called) >= 30
    assert np.mean(called) >= 0.95


@pytest.mark.long
@pytest.mark.timeout(7200)
def test_shares_that_are_called_stable_by_wear() -> None:
    """Random programs of machines with at most six modes, at 50 and 70 % of their limit with new edges."""
    words: dict[tuple[ToolWear, float], list[Stability]] = {
        (wear, part): [] for wear in WEAR_FACTORS for part in (0.5, 0.7)
    }
    for rng in np.random.default_rng(5).spawn(120):
        milling = random_case(rng)
        limit = limit_mm(milling) if len(milling.x + milling.y) <= 6 else math.inf
        for (wear, part), said in words.items() if math.isfinite(limit) else ():
            worn = msgspec.structs.replace(program(milling, part * limit), wear=wear)
            case = ProgramCase(worn, assembly(milling), MACHINE)
            said.append(classify_stability(case, run_monte_carlo(case)))
    shares = {key: float(np.mean([word is Stability.STABLE for word in said])) for key, said in words.items()}
    say(
        f"{len(words['new', 0.5])} programs: "
        + ", ".join(f"{wear} {part}: {shares[wear, part]:.0%}" for wear, part in shares)
    )
    assert len(words["new", 0.5]) >= 40
    assert all(word is not Stability.NOT_STABLE for said in words.values() for word in said)
    assert shares["new", 0.5] >= 0.8
    for part in (0.5, 0.7):
        assert shares["new", part] >= shares["used", part] >= shares["worn", part]
