"""Show what one tap test measured, and the results at the end of tap tests."""

from collections.abc import Sequence
from itertools import starmap

from acquisition import Conditions
from dsm import RemainingPreload
from lobewatch.logbook import Logbook
from lobewatch.machine import REFERENCE_CUT
from lobewatch.machine.settings.display_units import LENGTH
from lobewatch.measurement import Measurement, check_modes_together
from lobewatch.measurement.recording_questions import RECORDING_QUESTIONS, find_accepted_codes, format_not_asked
from lobewatch.monitoring.series_history import build_series_history, estimate_preload
from lobewatch.show.history import condition_texts
from lobewatch.show.models import calibration_json
from lobewatch.show.modes import grouped_remark_lines, mode_json, mode_table, sort_modes
from lobewatch.show.programs.advice import lobes_json
from lobewatch.show.programs.verdicts import CHECK_HINT, program_texts, verdict_json, verdict_table
from lobewatch.show.terminal.output import JsonObject, Texts, emit, notes, pick, remark_lines
from lobewatch.show.terminal.status_labels import status_label
from lobewatch.tap.session import TapSession
from lobewatch.tool import compute_lobes


def measurement_json(measurement: Measurement, logbook: Logbook) -> JsonObject:
    """Return a measurement, the diagrams of its tool as it was known then, and the remarks on it."""
    assembly = logbook.assembly(until=measurement.tap_id)
    lobes = compute_lobes(assembly, logbook.machine)
    followed, calibration = measurement.followed, measurement.calibration
    return {
        "tap_id": measurement.tap_id,
        "time": measurement.time.isoformat(),
        **pick(measurement, "tool", "direction"),
        "conditions": _tap_conditions(measurement, logbook).specified,
        "modes": list(map(mode_json, measurement.modes)),
        "followed": followed and mode_json(followed),
        "calibration": calibration and calibration_json(calibration),
        "preload_left": _remaining_preload(measurement, logbook),
        "lobes": list(starmap(lobes_json, lobes.items())),
        "remarks": assembly.remarks,
    }


def measurement_texts(m: Measurement, logbook: Logbook) -> Texts:
    """Return a measurement in words."""
    named = [f"tool {m.tool}", f"direction {m.direction}", *condition_texts(_tap_conditions(m, logbook))]
    texts: Texts = [f"{m.tap_id}  ({', '.join(named)})"]
    if m.modes:
        shown = sort_modes(m.modes, rejected=False)
        texts += [mode_table(shown), *grouped_remark_lines(shown, check_modes_together(m.modes))]
    if m.followed is not None:
        texts.append(f"followed mode: {m.followed.frequency:.2f} Hz")
    if m.calibration is not None:
        texts += [str(part) for part in (m.calibration, _remaining_preload(m, logbook)) if part is not None]
    assembly = logbook.assembly(until=m.tap_id)
    lobes = compute_lobes(assembly, logbook.machine).get(REFERENCE_CUT)
    if lobes is not None:
        low = lobes.minimum
        texts.append(f"{REFERENCE_CUT}: lowest limit {LENGTH.text(low.depth * 1e3, '.2f')} at {low.speed_rpm:.0f} rpm")
    asked = [remark for remark in logbook.status().remarks if remark.about == f"tap test {m.tap_id}"]
    further = [remark for remark in assembly.remarks if remark.code not in RECORDING_QUESTIONS]
    return [*texts, *remark_lines(further), *(f"question ({remark.code}): {remark.text}" for remark in asked)]


def _remaining_preload(measurement: Measurement, logbook: Logbook) -> RemainingPreload | None:
    """Compare the preload with that at the start of the series, as it was known at that time."""
    series = logbook.history.series(measurement.tool, measurement.direction)
    rows = [row for row in series if row.time <= measurement.time]
    if not rows or rows[-1].tap_id != measurement.tap_id:
        return None
    return estimate_preload(build_series_history(rows), logbook.machine)


def _tap_conditions(m: Measurement, logbook: Logbook) -> Conditions:
    return logbook.files.place(m.tap_id).entry.conditions


def emit_tap_results(logbook: Logbook, finished: Sequence[TapSession], as_json: bool, details: bool) -> None:
    """Print the stored tap tests and their results; as JSON the last test. details: modes, model, uncertainty, too."""
    for session in finished:
        measurement = session.measurement
        notes.print(*(f"saved {tap_id}\n" for tap_id in session.saved), sep="", end="")
        notes.print(*(f"accepted: {code}\n" for code in find_accepted_codes(measurement.remarks)), sep="", end="")
        if session.unasked:
            notes.print(format_not_asked(session.unasked, session.saved, logbook.questions), markup=False)
    last = finished[-1]
    payload = measurement_json(last.measurement, logbook)
    payload["remarks"] = [*payload["remarks"], *last.remarks]
    payload["programs"] = list(map(verdict_json, logbook.verdicts()))
    if last.across is not None:
        payload["across"] = {"tap_id": last.across.tap_id}
    emit(payload, as_json, *_result_texts(logbook, finished, details))


def _result_texts(logbook: Logbook, finished: Sequence[TapSession], details: bool) -> Texts:
    texts: Texts = []
    for session in finished:
        outcome = session.state.outcome
        texts += measurement_texts(session.measurement, logbook) if details else []
        texts += [session.across.text] if details and session.across is not None else []
        texts += [] if outcome is None or details else [f"{session.state.title}:", *outcome.texts]
    if details:
        texts += program_texts(logbook)
    elif verdicts := logbook.verdicts():
        texts += [verdict_table(verdicts), CHECK_HINT, "Modes, model and uncertainty: --details"]
    standing = logbook.status()
    return [*texts, f"{status_label(standing.status, standing.is_early)}  Next: {standing.next_step}"]
