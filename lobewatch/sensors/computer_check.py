"""Check the computer for a tap test: ports, rights, clock, disk, packages, browser."""

import os
import platform
import re
import shutil
import time
import webbrowser
from collections.abc import Iterator
from contextlib import suppress
from datetime import UTC, datetime
from importlib.metadata import PackageNotFoundError, requires, version
from pathlib import Path
from typing import Literal, NamedTuple

from acquisition import DeviceError, ScannedPort, explain_no_ports, find_driver, scan_ports
from acquisition.ports import SerialLink
from lobewatch.machine.folder import MachineFolder

MIN_FREE_BYTES = 200 << 20
"""Free bytes below which a tap test may not end, twenty times what one takes, chosen."""
AMPLE_FREE_BYTES = 2 << 30
"""Free bytes below which a year of tests may not fit, chosen."""
MAX_LATENCY_TIMER = 2
"""Harmless latency timer of an FTDI port (ms). The default of 16 ms delays the measurement of a rate."""
LATENCY_TIMER_FOLDER = Path("/sys/bus/usb-serial/devices")
"""Folder in which Linux keeps the latency timers of FTDI ports."""
MIN_CLOCK_YEAR = 2025
"""Year before which a clock is certainly wrong."""


class Finding(NamedTuple):
    """Result of one check."""

    subject: str
    """Subject in a word or two."""
    state: Literal["fine", "note", "hinders"]
    """State: "note" is worth knowing, "hinders" prevents a tap test."""
    text: str
    """Result in words."""
    cure: str = ""
    """Remedy, empty if none is needed."""


def check_computer(machine: MachineFolder | None = None, now: float | None = None) -> tuple[Finding, ...]:
    """Check this computer, in the order in which a test needs it.

    Parameters
    ----------
    machine
        Machine folder to check too.
    now
        Present time (s, UTC), None for the clock's.

    Returns
    -------
    tuple of Finding
        Result of each check.
    """
    folder = machine.path if machine else Path.cwd()
    moment = datetime.fromtimestamp(time.time() if now is None else now, UTC)
    return (
        *_check_versions(),
        *_check_ports(machine),
        *_check_latency(LATENCY_TIMER_FOLDER),
        _check_clock(machine, moment),
        _check_disk_space(folder),
        *_check_extras(machine),
        _check_browser(),
        _check_load(),
    )


def _check_versions() -> Iterator[Finding]:
    names = "numpy", "scipy", "h5py", "matplotlib", "pyserial"
    listed = ", ".join(f"{name} {version(name)}" for name in names)
    text = f"lobewatch {version('lobewatch')}, Python {platform.python_version()} on {platform.platform(terse=True)}"
    yield Finding("versions", "fine", f"{text}, {listed}")


def _check_ports(machine: MachineFolder | None) -> Iterator[Finding]:
    """Check the ports. A port that machine.toml names must exist."""
    survey = scan_ports()
    for port in survey.ports:
        yield _check_port(port)
    for remark in survey.remarks:
        yield Finding("drivers", "note", f"{remark.about}: {remark.text}", remark.cure)
    if not survey.ports:
        yield Finding("ports", "note", "none", explain_no_ports())
    wanted = machine.machine.daq.port if machine else ""
    if wanted and wanted not in [port.port.device for port in survey.ports]:
        subject = f"port {wanted}"  # a pseudo-terminal, the network, or missing
        try:
            SerialLink(wanted).close()
            yield Finding(subject, "fine", "port set in [daq], can be opened")
        except DeviceError as error:
            yield Finding(subject, "hinders", f"port set in [daq], but {error.text}", error.cure)


def _check_port(port: ScannedPort) -> Finding:
    subject = f"port {port.port.device}"
    if port.failure is not None:
        return Finding(subject, "hinders", port.failure.text, port.failure.cure)
    if port.answer is None:
        return Finding(subject, "fine", port.text)
    return Finding(subject, "fine", f"{port.answer.identity.model} answers ({port.answer.driver})")


def _check_latency(folder: Path) -> Iterator[Finding]:
    """Check the ports whose driver waits before it delivers data."""
    for timer in sorted(folder.glob("*/latency_timer")):
        try:
            wait = int(timer.read_text("ascii"))
        except (OSError, ValueError):
            continue
        port = f"latency of {timer.parent.name}"
        cure = "" if wait <= MAX_LATENCY_TIMER else f"Run echo 1 | sudo tee {timer}"
        yield Finding(port, "note" if cure else "fine", f"{wait} ms", cure)


def _check_clock(machine: MachineFolder | None, now: datetime) -> Finding:
    """Check the clock: one that is behind stored tap tests is wrong."""
    written = [datetime.fromisoformat(entry.time) for entry in machine.taps()] if machine else []
    newest = max((moment.astimezone(UTC) for moment in written), default=None)
    text = f"{now:%Y-%m-%d %H:%M} UTC"
    cure = "Set the clock (`timedatectl set-ntp true` on Linux)"
    if now.year < MIN_CLOCK_YEAR:
        return Finding("clock", "hinders", text, cure)
    if newest is not None and newest > now:
        return Finding("clock", "hinders", f"{text}, before the newest tap test ({newest:%Y-%m-%d %H:%M})", cure)
    return Finding("clock", "fine", text)


def _check_disk_space(folder: Path) -> Finding:
    """Check free space and write permission."""
    subject = f"disk of {folder}"
    if not os.access(folder, os.W_OK):
        return Finding(subject, "hinders", "no write permission", "Get write permission for the folder")
    free = shutil.disk_usage(folder).free
    text = f"{free / 1e9:.3g} GB free"
    if free >= AMPLE_FREE_BYTES:
        return Finding(subject, "fine", text)
    return Finding(subject, "hinders" if free < MIN_FREE_BYTES else "note", text, "Free space on that disk")


def _check_extras(machine: MachineFolder | None) -> Iterator[Finding]:
    """Check the installed extras. The one that the machine's driver needs must be there."""
    packages: dict[str, list[str]] = {}
    for line in requires("lobewatch") or ():
        if match := re.match(r"([\w.-]+).*extra == ['\"]([\w-]+)['\"]", line):
            packages.setdefault(match[2], []).append(match[1])
    shown = sorted(set(packages) - {"dev", "bench"})
    missing = [extra for extra in shown if not all(map(_is_installed, packages[extra]))]
    there = ", ".join(extra for extra in shown if extra not in missing) or "none"
    cure = f"If you need {', '.join(missing)}, run pip install 'lobewatch[NAME]'" if missing else ""
    yield Finding("extras", "fine", f"installed: {there}", cure)
    needed = find_driver(machine.machine.daq.driver).extra if machine else ""
    if needed in missing:
        text = f'driver = "{needed}" needs the extra {needed}, which is not installed'
        yield Finding("driver", "hinders", text, f"Run pip install 'lobewatch[{needed}]'")


def _is_installed(package: str) -> bool:
    with suppress(PackageNotFoundError):
        return bool(version(package))
    return False


def _check_browser() -> Finding:
    """Check whether a page can be opened here. Another computer can show it, too."""
    try:
        name = webbrowser.get().__class__.__name__
    except webbrowser.Error:
        cure = "Use screen.ScreenServer with ScreenServer.listen 0.0.0.0, and open its address on a tablet"
        return Finding("browser", "note", "no browser on this computer", cure)
    return Finding("browser", "fine", f"installed ({name})")


def _check_load() -> Finding:
    """Check the load: a busy computer measures rates badly."""
    cores = os.cpu_count() or 1
    load = os.getloadavg()[0] if hasattr(os, "getloadavg") else 0.0
    busy = load > cores
    text = f"{cores} cores, load {load:.1f}"
    return Finding("processor", "note" if busy else "fine", text, "Close other programs" if busy else "")
