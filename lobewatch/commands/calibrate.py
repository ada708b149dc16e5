"""Command `lobewatch calibrate`: fit bearing and joint stiffness to measured natural frequencies."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Annotated

from typer import Exit, Option

from lobewatch.commands.shared_options import SpindleMachine, open_folder
from lobewatch.show.terminal.output import Json, emit


def calibrate(
    machine: SpindleMachine,
    frequency: Annotated[list[float] | None, Option(help="Measured natural frequency (Hz), repeatable.")] = None,
    frequency_std: Annotated[
        list[float] | None, Option(help="Standard error of each --frequency (Hz), repeatable.")
    ] = None,
    mode: Annotated[
        list[int] | None,
        Option(
            min=1,
            max=50,
            help="Mode number of each --frequency or --tool, repeatable. Default: [mode] model_mode, or 1, 2, ...",
        ),
    ] = None,
    group: Annotated[
        list[str] | None, Option(help="Group of bearings or joints to fit, repeatable. Default: all.")
    ] = None,
    damping_ratio: Annotated[
        float | None, Option(help="Measured damping ratio (-) of the first mode, to fit bearing dampers too.")
    ] = None,
    tool: Annotated[
        list[str] | None,
        Option(help="Tool whose newest tap tests are used instead of --frequency. Give --tool at least twice."),
    ] = None,
    direction: Annotated[
        str | None, Option(help="Direction of the tap tests: x or y. Default: from the newest test.")
    ] = None,
    as_json: Json = False,
) -> None:
    """Calibrate bearings and joints to measured natural frequencies.

    One frequency gives one stiffness factor for all bearings. Several frequencies give one factor for each group. Two
    or more tools also give the joint between tool and spindle, as lines for machine.toml. No file is changed.

    Exit code 1: the tools do not fit one spindle.

    Examples
    --------
      lobewatch calibrate trial --frequency 1550 --frequency-std 0.4
      lobewatch calibrate trial --frequency 1550 --mode 1 --damping-ratio 0.03 --json
      lobewatch calibrate trial --frequency 1550 --frequency 2600 --group front --group rear
      lobewatch calibrate mill-3 --tool "end mill 12" --tool "end mill 12 long"
    """
    if tool:
        given = {"--frequency": frequency, "--frequency-std": frequency_std, "--group": group}
        _reject_with_tools({**given, "--damping-ratio": damping_ratio})
        _calibrate_from_tools(machine, tool, direction, mode or [], as_json=as_json)
        return
    if not frequency or direction is not None:
        raise ValueError("Give --frequency without --direction, or --tool at least twice.")
    from lobewatch.measurement import calibrate_model
    from lobewatch.show.models import model_calibration_json, model_calibration_texts

    _check_counts(len(frequency), frequency_std or [], mode or [])
    calibration = calibrate_model(
        open_folder(machine).machine, frequency, frequency_std or [], mode or [], group or [], damping_ratio
    )
    emit(model_calibration_json(calibration), as_json, *model_calibration_texts(calibration))


def _reject_with_tools(given: Mapping[str, object]) -> None:
    named = [option for option, value in given.items() if value is not None and value != []]
    if named:
        raise ValueError(f"--tool cannot be used with {', '.join(named)}. Leave out --tool or {' and '.join(named)}.")


def _calibrate_from_tools(
    machine: Path, tools: Sequence[str], direction: str | None, mode: Sequence[int], as_json: bool
) -> None:
    from lobewatch.logbook import Logbook
    from lobewatch.logbook.joint_calibration import calibrate_joints
    from lobewatch.show.models import tools_json, tools_texts

    calibration = calibrate_joints(Logbook(open_folder(machine)), tools, direction, mode)
    emit(tools_json(calibration), as_json, *tools_texts(calibration))
    raise Exit(int(calibration.fit.has_misfit))


def _check_counts(frequencies: int, stds: Sequence[float], modes: Sequence[int]) -> None:
    for option, values in (("--frequency-std", stds), ("--mode", modes)):
        if values and len(values) != frequencies:
            raise ValueError(
                f"{len(values)} {option} for {frequencies} --frequency. Give {option} for all, or leave out {option}."
            )
