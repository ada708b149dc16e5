"""Foreign bytes: no traceback, no hang over 5 s, nothing silent. Each input that broke something is kept in corpus/.

Save the bytes that a failure prints as a new file of the corpus, mend the program, and run this file again.
"""

from __future__ import annotations

import tempfile
import time
from pathlib import Path

import pytest
from hypothesis import HealthCheck, given, note, seed, settings

from tests.fuzz.targets import CORPUS, TARGETS, Target

MAX_CHECK_TIME = 5.0
"""Longest processor time of one input (s)."""
LONG_RUN_TIME = 60.0
"""Time of a long run of one target (s)."""

of_each_target = pytest.mark.parametrize("target", TARGETS, ids=lambda target: target.name)


def check(target: Target, content: bytes) -> None:
    """Check one input."""
    begin = time.process_time()
    with tempfile.TemporaryDirectory() as parent:
        folder = Path(parent) / "input"  # `status` looks for copies next to it
        folder.mkdir()
        target.check(content, folder)
    assert time.process_time() - begin < MAX_CHECK_TIME


def fuzz(target: Target, examples: int, number: int) -> None:
    """Check some inputs."""

    @seed(number)
    @settings(max_examples=examples, database=None, deadline=None, suppress_health_check=list(HealthCheck))
    @given(target.inputs())
    def run(content: bytes) -> None:
        note(f"{target.name}: {content!r}")
        check(target, content)

    run()


@of_each_target
def test_kept_inputs(target: Target) -> None:
    kept = sorted((CORPUS / target.name).iterdir())
    assert kept
    for path in kept:
        check(target, path.read_bytes())


@of_each_target
def test_inputs_that_are_nearly_right(target: Target) -> None:
    fuzz(target, target.examples, 1)


@pytest.mark.long
@of_each_target
def test_inputs_that_are_nearly_right_for_a_minute(target: Target) -> None:
    end = time.monotonic() + LONG_RUN_TIME
    number = int(time.time())
    while time.monotonic() < end:
        number += 1
        fuzz(target, target.examples, number)
