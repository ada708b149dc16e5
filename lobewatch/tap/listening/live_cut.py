"""The pictures of a cut that is listened to, from the first word to the last."""

from __future__ import annotations

import contextlib
import time
from collections.abc import Iterator

from acquisition.files.cut_file import CutSignal
from lobewatch.logbook import Logbook
from lobewatch.logbook.cut_comparison import CutComparison, compare_cut
from lobewatch.machine.settings.cut_setting import CutSetting
from lobewatch.tap.listening.cut_state import CutState, CutStep, cut_curves, word_of
from lobewatch.tap.publisher import Pictures


@contextlib.contextmanager
def cut_pictures(logbook: Logbook, setting: CutSetting) -> Iterator[Pictures[CutState]]:
    """Begin with where the sensor belongs; what is raised within is the last of them."""
    named = f"{setting.program or 'reference cut'}, {setting.speed_rpm:g} rpm, {1e3 * setting.depth:g} mm"
    title, reason = f"{logbook.machine.machine.name}: {named}", "From the tool to the housing; spindle turning in air."
    pictures = Pictures(CutState(0, CutStep.SENSOR, title, reason=reason), time.monotonic)
    try:
        yield pictures
    except KeyboardInterrupt:
        pictures.show(word=CutStep.FAILED, reason="Stopped at the terminal.", level=None, left=None)
        raise
    except (OSError, RuntimeError, ValueError) as error:
        pictures.show(word=CutStep.FAILED, reason=str(error), level=None, left=None)
        raise


def judge_live(logbook: Logbook, setting: CutSetting, signal: CutSignal, pictures: Pictures[CutState]) -> CutComparison:
    """Listen to a recording, and show the word."""
    pictures.show(word=CutStep.JUDGING, reason="The cut is over.", level=None, left=None, cut_seconds=None)
    found = compare_cut(logbook, setting, signal)
    pictures.show(word=word_of(found), reason="", found=found, plots=cut_curves(found))
    return found
