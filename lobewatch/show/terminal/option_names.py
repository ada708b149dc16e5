"""Command-line names for the fields and functions that messages of the library name.

The library does not know the command line: its errors and remarks name a field (`Description.unit`) or a function
(`Logbook.verdicts`). A person at the terminal, and a program that reads the JSON, needs the option or the command.
"""

import math
import re
from collections.abc import Mapping
from typing import Any

OPTION_NAMES: Mapping[str, str] = {
    "accept_questions.codes": "--accept",
    "accept_settings.keys": "--accept",
    "acknowledge_alarms.until": "--until",
    "acquire_cut.file": "--file",
    "acquire_cut.port": "--port",
    "acquisition.measure_rate": "lobewatch sensors",
    "acquisition.scan_ports": "lobewatch ports",
    "add_event.new_baseline": "--new-baseline",
    "build_power_reading.power_kw": "--power",
    "calibrate_joints.mode": "--mode",
    "calibrate_joints.tools": "--tool",
    "check_mass.direction": "--direction",
    "check_mass.mass": "--mass-kg",
    "choose_cut.cut": "--cut",
    "choose_cut.program": "--program",
    "Circumstances.direction": "--direction",
    "Circumstances.tool": "--tool",
    "compare_lobes.cut": "--cut",
    "compute_lobe_chart.method": "--method",
    "Conditions.hours": "--hours",
    "Conditions.reclamped": "--reclamped",
    "CutEntry.at": "--date",
    "CutEntry.chatter_frequency_hz": "--frequency",
    "CutEntry.has_chatter": "--chatter",
    "CutEntry.is_stable": "--stable",
    "CutFileRequest.depth_mm": "--depth",
    "CutFileRequest.range_rpm": "--speeds",
    "CutFileRequest.speed_rpm": "--speed",
    "CutFileRequest.teeth": "--teeth",
    "cut_recording.acquire_cut": "lobewatch listen",
    "decide_hits.accept": "--accept-hit",
    "decide_hits.undo": "lobewatch modes MACHINE TAP --undo-hit",
    "Description.averages": "--averages",
    "Description.axes": "--axes",
    "Description.columns": "--columns",
    "Description.date": "--date",
    "Description.date_pattern": "--date-pattern",
    "Description.decimal": "--decimal",
    "Description.direction": "--direction",
    "Description.force": "--force",
    "Description.force_unit": "--force-unit",
    "Description.full_scale": "--full-scale",
    "Description.hit_files": "--one-test",
    "Description.one_test": "--one-test",
    "Description.pulses": "--pulses",
    "Description.quantity": "--quantity",
    "Description.rate": "--rate",
    "Description.response": "--response",
    "Description.sensitivity": "--sensitivity",
    "Description.sensor": "--sensor",
    "Description.skip": "--skip",
    "Description.spacing": "--spacing",
    "Description.start": "--start",
    "Description.tacho": "--tacho",
    "Description.unit": "--unit",
    "DynamicsSource.FRF": "--source frf",
    "DynamicsSource.MODES": "--source modes",
    "emulate_mass.mass": "--mass-kg",
    "EmulationSetup.tcp": "--tcp",
    "evaluate_requested.names": "--program",
    "exclude_entry": "exclude",
    "exclude_entry.reason": "--reason",
    "find_setup_question.name": "--edit",
    "fit_file_modes": "lobewatch modes",
    "fit_file_modes.accept": "--accept",
    "fit_file_modes.conjugate": "--conjugate",
    "fit_file_modes.hammer": "--hammer",
    "fit_file_modes.sensor": "--sensor-mass",
    "folder_files.make_machine_folder": "lobewatch init",
    "folder_files.make_machine_folder.template": "lobewatch init --example",
    "folder_updates.accept_settings": "lobewatch check MACHINE --accept",
    "folder_updates.add_event": "lobewatch event",
    "folder_updates.exclude_entry": "lobewatch exclude",
    "folder_updates.store_cut": "observe",
    "folder_updates.store_mode_edits": "lobewatch modes MACHINE TAP",
    "list_comparison_files.beside": "--beside",
    "LobeChart.source": "--source",
    "lobes.materials_by_name": "lobewatch materials",
    "Logbook.verdicts": "lobewatch check MACHINE",
    "Logbook.decide_hits": "modes --accept-hit and --reject-hit",
    "MachineFolder.accept": "replay --accept",
    "MachineFolder.contents": "lobewatch history",
    "MaintenanceEvent.time": "--date",
    "make_machine_folder": "lobewatch init",
    "make_machine_folder.template": "lobewatch init FOLDER --example",
    "modal.synthesize_frf": "lobewatch modes --figure",
    "ModeEdits.add": "--add",
    "ModeEdits.drop": "--drop",
    "ModeEdits.fix": "--fix",
    "MountingVariation.bad_share": "--bad-clampings",
    "MountingVariation.scatter": "--scatter",
    "MountingVariation.temperature_swing": "--temperature",
    "NO_MODE_EDITS": "--by-fit",
    "numpy.conj": "on the command line: --conjugate",
    "operator_entries.acknowledge_alarms": "lobewatch ack",
    "plan_session.port": "--port",
    "plan_session.resume=False": "--new",
    "pocket_depth.find_pocket_depths": "lobewatch suggest",
    "program_learning.find_next_cut": "lobewatch suggest",
    "ProgramTable.depth_mm": "--depth",
    "ProgramTable.direction": "--direction",
    "ProgramTable.feed_per_tooth_mm": "--feed-per-tooth",
    "ProgramTable.material": "--material",
    "ProgramTable.name": "--save",
    "ProgramTable.radial_depth_mm": "--radial",
    "ProgramTable.speed_rpm": "--speed",
    "ProgramTable.teeth": "--teeth",
    "ProgramTable.tool": "--tool",
    "ProgramTable.tool_diameter_mm": "--diameter",
    "rebuild_files.rebuild_files": "lobewatch rebuild",
    "record_cuts.time_limit": "--seconds",
    "rotate_structure.degrees": "--askew",
    "rotate_structure.direction": "--direction",
    "screen.ScreenServer": "--screen",
    "ScreenServer.listen": "--listen",
    "sensor_checks.check_skew": "lobewatch sensors --skew",
    "SeriesStatus.direction": "--direction",
    "SeriesStatus.tool": "--tool",
    "session.TapSession": "lobewatch tap",
    "store_recordings.keep_going": "--keep-going",
    "StatedCut.diameter_mm": "--diameter",
    "StatedCut.high_rpm": "--speeds",
    "StatedCut.low_rpm": "--speeds",
    "StatedCut.material": "--material",
    "StatedCut.radial_depth_mm": "--radial-depth",
    "StatedCut.teeth": "--teeth",
    "TapSession.run": "lobewatch tap",
    "Window.hit_at": "--hit-at",
    "Window.start": "--window-start",
    "Window.time_constant": "--window",
    "Workers.jobs": "--jobs",
    "Workers.scheduler": "--scheduler",
}
"""Option or command for each field or function that a message names."""

_NAMES = re.compile(rf"\b(?:{'|'.join(map(re.escape, sorted(OPTION_NAMES, key=len, reverse=True)))})\b")


def with_option_names(text: str) -> str:
    """Replace the library fields and functions that a message names by their options and commands."""
    return _NAMES.sub(lambda match: OPTION_NAMES[match[0]], text)


def with_option_names_inside(value: Any) -> Any:
    """Replace the names in all texts of a value made of dicts, lists and texts; infinite and NaN become None."""
    if isinstance(value, dict):
        return {key: with_option_names_inside(entry) for key, entry in value.items()}
    if isinstance(value, (list, tuple)):
        return [with_option_names_inside(entry) for entry in value]
    if isinstance(value, float) and not math.isfinite(value):
        return None
    return with_option_names(value) if type(value) is str else value
