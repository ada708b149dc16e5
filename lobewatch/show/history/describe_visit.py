"""What tap tests at one machine have given, for the one who tapped: the light and the next step last."""

from __future__ import annotations

from collections.abc import Sequence

from rich.table import Table

from lobewatch.logbook import Logbook
from lobewatch.measuring.questions import accepted_codes, unasked_text
from lobewatch.show.history.describe_measurement import measurement_json, measurement_texts
from lobewatch.show.programs.describe_verdicts import program_texts, programs_json, verdict_table
from lobewatch.show.terminal.light_words import light_word
from lobewatch.show.terminal.output import emit, notes
from lobewatch.tap.session import TapSession


def emit_visit(logbook: Logbook, finished: Sequence[TapSession], as_json: bool, details: bool) -> None:
    """Print what was stored and what it says; as JSON the last test. details: modes, model and doubt, too."""
    for session in finished:
        measurement = session.measurement
        notes.print(*(f"saved {tap_id}\n" for tap_id in session.saved), sep="", end="")
        notes.print(*(f"accepted: {code}\n" for code in accepted_codes(measurement.remarks)), sep="", end="")
        if session.unasked:
            notes.print(unasked_text(session.unasked, session.saved, logbook.questions), markup=False)
    last = finished[-1]
    payload = measurement_json(last.measurement, logbook) | {"programs": programs_json(logbook.verdicts())}
    if last.across is not None:
        payload["across"] = {"tap_id": last.across.tap_id}
    emit(payload, as_json, *_texts(logbook, finished, details))


def _texts(logbook: Logbook, finished: Sequence[TapSession], details: bool) -> list[str | Table]:
    texts: list[str | Table] = []
    for session in finished:
        outcome = session.state.outcome
        texts += measurement_texts(session.measurement, logbook) if details else []
        texts += [session.across.text] if details and session.across is not None else []
        texts += [] if outcome is None or details else [f"{session.state.title}:", *outcome.texts]
    if details:
        texts += program_texts(logbook)
    elif verdicts := logbook.verdicts():
        texts += [verdict_table(verdicts), "lobewatch check says what decides; --details shows modes, model and doubt"]
    standing = logbook.standing()
    return [*texts, f"{light_word(standing.light, standing.is_early)}  next: {standing.next_step}"]
