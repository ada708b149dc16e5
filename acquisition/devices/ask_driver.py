"""A question to a driver, which may be of another package: it fails or hangs alone."""

from __future__ import annotations

import queue
import threading
from collections.abc import Callable

from acquisition.devices.registry import not_answering
from acquisition.errors import DeviceError
from acquisition.plugin import words_of

PROBE_TIME = 10.0
"""Time within which a driver has said who is there (s), three times what ours take; chosen."""


def ask_driver(name: str, question: Callable[[], object], about: str) -> object:
    """What a driver answers; None for a DeviceError (unplugged while it was asked), a Remark where it fails or hangs.

    about: what it is asked, e.g. "who is on COM3".
    """
    answers = queue.SimpleQueue[object]()

    def ask() -> None:
        try:
            answers.put(question())
        except BaseException as error:  # noqa: BLE001  (of another package: it ends nothing of ours)
            answers.put(error)

    threading.Thread(target=ask, name=f"question to {name}", daemon=True).start()
    try:
        answer = answers.get(timeout=PROBE_TIME)
    except queue.Empty:
        return not_answering(name, f"has not answered within {PROBE_TIME:g} s {about}")
    if isinstance(answer, DeviceError):
        return None
    if isinstance(answer, BaseException):
        return not_answering(name, f"fails when asked {about} ({words_of(answer)})")
    return answer
