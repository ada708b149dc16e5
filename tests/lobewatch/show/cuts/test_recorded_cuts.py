"""Test that every verdict on a recorded cut, and every fault of a recording, has its text."""

from __future__ import annotations

from typing import get_args

import pytest

from lobewatch.cuts.chatter_detection import detection
from lobewatch.show.cuts.recorded_cuts import FAULT_TEXTS, NEXT_STEP_TEXTS

pytestmark = pytest.mark.quick
