"""Fixtures of the tests of the paper comparison."""

from __future__ import annotations

import pytest

from lobewatch.paper import PaperStudy, study_paper


@pytest.fixture(scope="session")
def study() -> PaperStudy:
    """One run."""
    return study_paper()
