"""CPU time of what lobewatch does before and without numbers: python bench/bench_start.py [RUNS] [LOBEWATCH ...].

User and system time of the whole process, minimum and median of RUNS (20) runs; several lobewatch commands (those of
two checkouts, say) are run in turn, so that a busy computer does the same to each.
"""

from __future__ import annotations

import resource
import statistics
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from functools import partial
from pathlib import Path

from bench_plant import make_machine
from race import Race

COMMANDS = (
    "--version",
    "--help",
    "chek",
    "init FOLDER",
    "ports",
    "check --help",
    "tap --help",
)
"""Commands as typed; `chek` is a typing error, FOLDER is a new folder each time."""


GREETING = """
import typer
app = typer.Typer()
@app.command()
def greet(name: str) -> None:
    print(name)
app()
"""
"""A program with one command."""
IMPORTS = "import h5py, numpy, typer"


def races() -> Iterator[Race]:
    """Compare with empty programs that import the same libraries."""
    start = partial(subprocess.run, stdout=subprocess.DEVNULL, check=True)
    lobewatch = [sys.executable, "-m", "lobewatch.cli"]
    yield Race(
        "`lobewatch --help`",
        lambda: start([*lobewatch, "--help"]),
        "typer with one command",
        lambda: start([sys.executable, "-c", GREETING, "--help"]),
    )
    with tempfile.TemporaryDirectory() as scratch:
        machine = Path(scratch, "mill")
        make_machine(machine, 24)
        start([*lobewatch, "check", str(machine)])
        for command in ("history", "trend", "check"):
            yield Race(
                f"`lobewatch {command}`, 24 tap tests",
                partial(start, [*lobewatch, command, str(machine)]),
                f"`{IMPORTS}`",
                lambda: start([sys.executable, "-c", IMPORTS]),
            )


def cpu_seconds(command: list[str]) -> float:
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    subprocess.run(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, check=False)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    return after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime


def main() -> None:
    runs = int(sys.argv[1]) if len(sys.argv) > 1 else 20
    programs = sys.argv[2:] or [str(Path(sys.executable).with_name("lobewatch"))]
    print("CPU s, minimum and median of", runs, "runs")
    print(f"{'command':14}", *(f"{number}: {program}" for number, program in enumerate(programs)), sep="  ")
    with tempfile.TemporaryDirectory() as work:
        for command in COMMANDS:
            seconds: list[list[float]] = [[] for _ in programs]
            for run in range(runs):
                for number, program in enumerate(programs):
                    folder = str(Path(work) / f"{number}-{run}")
                    arguments = [folder if word == "FOLDER" else word for word in command.split()]
                    seconds[number].append(cpu_seconds([program, *arguments]))
            print(f"{command:14}", *(f"{min(one):.3f} {statistics.median(one):.3f}" for one in seconds), sep="  ")


if __name__ == "__main__":
    main()
