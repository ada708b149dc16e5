"""Command `lobewatch replay`: store recorded files as tap tests."""

from datetime import datetime
from pathlib import Path
from typing import Annotated, Any

from typer import Argument, Option

from lobewatch.commands import shared_options as shared
from lobewatch.show.terminal.output import Json, print_remarks


@shared.add_file_options()
def replay(
    machine: shared.Machine,
    files: Annotated[list[Path], Argument(help='Recorded hits or FRFs: files, folders, patterns ("2024/*.mat").')],
    tool: Annotated[str, Option(help="Tool in the spindle. Default: from the file, or [tap] tool.")] = "",
    direction: Annotated[str, Option(help="Direction at the tool tip: x or y. Default: from the file, or x.")] = "",
    date: Annotated[
        datetime | None, shared.LocalTime(help="Recording date (local time). Default: from the file.")
    ] = None,
    date_pattern: Annotated[str, Option(help='Date format in file names: "%Y%m%d". With "/" in paths.')] = "",
    *,
    file_options: shared.FileOptions,
    dry_run: Annotated[bool, Option("--dry-run", help="Preview the result without storing it.")] = False,
    keep_going: Annotated[
        bool, Option("--keep-going", help="Store usable files even if other files fail (exit code 2).")
    ] = False,
    jobs: Annotated[int, Option(min=1, max=64, help="Number of parallel processes.")] = 1,
    scheduler: Annotated[str, Option(help="Address of a Dask scheduler, such as tls://10.0.0.5:8786.")] = "",
    accept: Annotated[
        list[str] | None,
        Option(help="Accept this warning code (repeatable)."),
    ] = None,
    accept_hit: shared.AcceptedHits = None,
    reject_hit: shared.RejectedHits = None,
    add: shared.AddedModes = None,
    drop: shared.DroppedModes = None,
    fix: shared.FixedModes = None,
    temperature: Annotated[float | None, Option(help="Spindle temperature (degC).")] = None,
    hours: Annotated[float | None, Option(help="Running hours of the spindle (h).")] = None,
    note: Annotated[str, Option(help="Note on these tests.")] = "",
    reclamped: Annotated[bool, Option("--reclamped", help="The tool was reclamped before these tests.")] = False,
    as_json: Json = False,
) -> None:
    """Store recorded files as tap tests.

    All files are checked before the first one is stored, in order of date. If data is missing, an error names the
    option for the data. Repeat an interrupted command to continue after the last stored test. An implausible recording
    is stored with a question. Answer the question with --accept, now or later.

    Examples
    --------
      lobewatch replay mill-3 acceleration.lvm
      lobewatch replay mill-3 2024 --dry-run --unit g/N --date-pattern "%Y%m%d"
      lobewatch replay mill-3 h.mat --columns "frequency=Freq,frf=H:2" --unit m/N --date 2024-05-01
      lobewatch replay mill-3 hit1.csv hit2.csv hit3.csv --one-test --date 2026-11-20 --direction x
      lobewatch replay mill-3 hits.npy --axes hits,channels,samples --columns "force [N],acceleration [g]" --rate 51200
      lobewatch replay mill-3 mill-3/taps/ID.h5 --accept frequency-jump
      lobewatch replay mill-3 hits.uff --accept-hit 3:double-hit --reject-hit 5
    """
    from acquisition import Conditions, DataError
    from acquisition.hit_quality.decide_hits import parse_hit_decisions
    from lobewatch.logbook import Logbook
    from lobewatch.logbook.operator_entries import store_edits
    from lobewatch.logbook.recordings.recorded_files import find_recordings
    from lobewatch.logbook.recordings.store_recordings import format_rejections
    from lobewatch.logbook.replay_preview import preview_replay
    from lobewatch.measurement.recording_questions import check_question_codes, format_not_asked
    from lobewatch.measurement.share_work import Workers
    from lobewatch.notify.publish_status import publish_on_change
    from lobewatch.show.replays import ReplayProgress, emit_preview, emit_replay
    from modal import parse_mode_edits

    known: dict[str, Any] = {"date": date, "date_pattern": date_pattern, "tool": tool, "direction": direction}
    known["conditions"] = Conditions(temperature_c=temperature, hours=hours, note=note, reclamped=reclamped)
    chosen = parse_hit_decisions(accept_hit or (), reject_hit or ())
    description = file_options.description(**known, hit_decisions=chosen)
    print_remarks((workers := Workers(jobs, scheduler)).remarks)
    logbook, (files, passed) = Logbook.open(machine), find_recordings(files, repeated=file_options.one_test)
    recordings, description = shared.join_hit_files(files, description)
    codes, edits = check_question_codes(accept or ()), parse_mode_edits(add, drop, fix)
    if dry_run:
        if edits:
            raise ValueError(f"{edits}: --dry-run stores nothing. Preview the edits with lobewatch modes FILE.")
        with ReplayProgress() as bar:
            previews = preview_replay(logbook, recordings, description, bar, workers)
        emit_preview(previews, passed, as_json=as_json)
        return
    with publish_on_change(logbook):
        with ReplayProgress() as bar:
            outcome = logbook.replay_all(recordings, description, workers=workers, keep_going=keep_going, progress=bar)
            not_chosen = store_edits(logbook, outcome.tap_ids, edits)
            unasked = logbook.accept(outcome.tap_ids, codes)
            if outcome.new_tap_ids:
                bar("measure", 0, len(outcome.new_tap_ids))
                _ = logbook.history
        emit_replay(outcome, logbook, len(files), passed, [code for code in codes if code not in unasked], as_json)
        wrong = outcome.rejected and format_rejections(outcome.rejected, len(recordings), stored=True)
        if wrong or not_chosen or unasked:
            raise DataError(wrong or not_chosen or format_not_asked(unasked, outcome.tap_ids, logbook.questions))
