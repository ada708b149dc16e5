"""Command `lobewatch rebuild`: rebuild the history or a damaged journal."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from typer import Option

from lobewatch.commands.shared_options import FleetFolder
from lobewatch.show.terminal.output import Json, emit, print_remarks

if TYPE_CHECKING:
    from lobewatch.measurement.share_work import Workers
    from lobewatch.show.replays import MachineRebuild


def rebuild(
    machine: FleetFolder,
    jobs: Annotated[int, Option(min=1, max=64, help="Number of parallel processes.")] = 1,
    scheduler: Annotated[str, Option(help="Address of a Dask scheduler, such as tls://10.0.0.5:8786.")] = "",
    as_json: Json = False,
) -> None:
    """Rebuild the history, and a damaged journal.

    Damaged files are moved to a folder named damaged. Renamed tap files get their names back, and intact tap files
    are added to the journal. A lost tap file counts again after you restore it from a backup.

    Examples
    --------
      lobewatch rebuild mill-3
      lobewatch rebuild mills --scheduler tls://10.0.0.5:8786
    """
    from acquisition import DataError
    from acquisition.errors import format_error
    from lobewatch.measurement.share_work import Workers
    from lobewatch.show import replays as show

    workers, folders = Workers(jobs, scheduler), _find_machine_folders(machine)
    print_remarks(workers.remarks)
    if not folders:
        outcome = _rebuild_machine(machine, workers)
        emit(show.rebuild_json(outcome), as_json, *show.rebuild_texts(outcome))
        return
    outcomes, refused = dict[str, show.MachineRebuild](), list[str]()
    for folder in folders:
        try:
            outcomes[folder.name] = _rebuild_machine(folder, workers)
        except Exception as error:  # noqa: BLE001 - a damaged machine must not stop the others
            refused.append(format_error(error))
    emit(show.folder_rebuild_json(outcomes), as_json, *show.folder_rebuild_texts(outcomes, len(folders)))
    if refused:
        raise DataError("\n".join([f"{len(refused)} of {len(folders)} machines cannot be rebuilt", *refused]))


def _find_machine_folders(path: Path) -> list[Path]:
    """Find the machine folders in a folder that is not a machine folder itself."""
    from lobewatch.machine.folder import list_tap_files

    if (path / "machine.toml").is_file() or list_tap_files(path):
        return []
    return sorted(folder for folder in path.glob("*/") if (folder / "machine.toml").is_file() or list_tap_files(folder))


def _rebuild_machine(path: Path, workers: "Workers") -> "MachineRebuild":
    """Rebuild a machine and publish its status."""
    from lobewatch.logbook import Logbook
    from lobewatch.logbook.rebuild_history import rebuild_history
    from lobewatch.machine.rebuild_files import rebuild_files
    from lobewatch.notify.publish_status import publish_status
    from lobewatch.show import replays as show

    repairs = rebuild_files(path)
    logbook = Logbook.open(path)
    n_taps = rebuild_history(logbook, workers, show.make_rebuild_progress(path.name))
    is_saved = all(remark.code != "history-in-memory" for remark in logbook.remarks)
    publish_status(logbook)
    return show.MachineRebuild(repairs, n_taps, is_saved, logbook.remarks)
