"""Run all benchmarks against other packages, write docs/studies/performance.md and report slowdowns.

    python3 run.py bench [--quick]         (in an environment with the peers; a quarter of an hour)

CPU time, one BLAS thread, lobewatch and the other package in turns. A race whose package is not installed is reported
and left out. --quick: one round each, nothing is written.
"""

from __future__ import annotations

import argparse
import importlib
import os
import platform
import sys
import warnings
from collections.abc import Iterable, Iterator, Sequence
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

import msgspec
from race import Race, Result, run
from threadpoolctl import threadpool_limits

ROOT = Path(__file__).parents[1]
PAGE, STATED = ROOT / "docs" / "studies" / "performance.md", Path(__file__).with_name("performance.json")
"""Page, and what it states."""
BENCHES = {
    "Modes": "bench_modal",
    "Hits": "bench_acquisition",
    "Tap files": "bench_archive",
    "Recordings": "bench_replay",
    "Spindle model": "bench_dsm",
    "Lobes": "bench_lobes",
    "Cuts": "bench_listen",
    "Commands": "bench_start",
    "One tap test from its hits to the verdicts": "bench_chain",
}
"""Modules with races, by headings of the page."""
PACKAGES = ("numpy", "scipy", "h5py", "typer", "pyFRF", "sdypy-EMA", "ross-rotordynamics")
"""Packages whose versions are stated."""
WORSE = 0.75
"""Ratio over the stated one below which it is worse: from run to run ratios move by a quarter."""
HEAD = """# Speed

lobewatch is faster than packages that solve the same task. Programs that solve only a part of it can be faster. You can
repeat this comparison: `python3 run.py bench` writes this page.

Times are median CPU times with one BLAS thread, measured in turns. The ratio is the time of the other package divided
by that of lobewatch, with its range.

{about}

| task | lobewatch | compared with | ratio |
|---|---|---|---|
"""
TAIL = """
Five measured FRFs of a tool, with noise and 18 modes, take 2.3 times the CPU time of sdypy-EMA: each band is fitted
several times, and again for its errors. These FRFs are not part of lobewatch ([study](performance-modal.md)).

The other packages get the true frequencies and a suitable mesh, and none of them computes errors. Unless stated
otherwise, a hit has 2 x 65536 samples. sdypy-EMA has order 60, the semi-discretisation 40 intervals. Commands include
the start of Python.
[The studies](README.md) have more figures.
"""


class Stated(msgspec.Struct):
    """One run."""

    about: str
    """Machine and versions."""
    results: dict[str, list[Result]]
    """Results by headings."""


def races(heading: str) -> Iterator[Race]:
    """Return the races of a bench whose peers are installed; report the others."""
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            yield from importlib.import_module(BENCHES[heading]).races()
    except ImportError as error:
        print(f"{heading}: left out from here on, {error.name} is not installed", file=sys.stderr)


def about() -> str:
    """Machine and versions."""
    names = []
    for name in PACKAGES:
        try:
            names.append(f"{name} {version(name)}")
        except PackageNotFoundError:
            continue
    computer = f"{platform.machine()}, {os.cpu_count()} cores, load {os.getloadavg()[0]:.1f} at the start"
    return f"Python {platform.python_version()}, {', '.join(names)}. {platform.system()}, {computer}."


def page(stated: Stated) -> str:
    """The page of a run."""
    rows = [_row(result) for results in stated.results.values() for result in results]
    return HEAD.format(about=stated.about) + "\n".join(rows) + "\n" + TAIL


def _row(result: Result) -> str:
    span = f" ({_times(result.least)}-{_times(result.most)})" if result.least < result.most else ""
    cells = (result.question, _time(result.ours_s), result.peer)
    return f"| {' | '.join(cells)} | **{_times(result.times)}**{span} |"


def _times(ratio: float) -> str:
    return f"{ratio:.2g}" if ratio < 100 else f"{ratio:.0f}"


def _time(seconds: float) -> str:
    for unit, size in (("s", 1.0), ("ms", 1e-3)):
        if seconds >= size:
            return f"{seconds / size:.3g} {unit}"
    return f"{1e6 * seconds:.3g} us"


def worse(results: Iterable[Result], stated: Iterable[Result]) -> Iterator[str]:
    """Yield a line for each result that is slower relative to its competitor than stated."""
    before = {(result.question, result.peer): result.times for result in stated}
    for result in results:
        was = before.get((result.question, result.peer))
        if was is not None and result.times < WORSE * was:
            times = f"{_times(result.times)} times as fast as {result.peer}, stated {_times(was)}"
            yield f"got slower: {result.question}: {times}"


def read_stated(file: Path) -> Stated:
    """The run that the page shows; an empty one where there is none yet."""
    return msgspec.json.decode(file.read_bytes(), type=Stated) if file.exists() else Stated("", {})


def measured(headings: Sequence[str], quick: bool) -> dict[str, list[Result]]:
    """Return results by heading; print each at once."""
    results: dict[str, list[Result]] = {}
    for heading in headings:
        for race in races(heading):
            result = run(race, quick)
            results.setdefault(heading, []).append(result)
            print(f"{_times(result.times):>6} x  {result.question}, compared with {result.peer}", flush=True)
    return results


def beside_stated(run_of: str, results: dict[str, list[Result]], before: Stated) -> Stated:
    """A run, with what was stated before under headings that it left out."""
    if set(results) >= set(before.results):
        return Stated(run_of, results)
    return Stated(f"{', '.join(results)}: {run_of}\n\nOthers: {before.about}", before.results | results)


def main() -> None:
    """Run all races."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("--quick", action="store_true", help="a round each, nothing is written")
    parser.add_argument("headings", nargs="*", metavar="HEADING", help="these only, the others stay as stated")
    wanted = parser.parse_args()
    os.environ["OPENBLAS_NUM_THREADS"] = "1"  # of the commands that are started
    os.environ.pop("PYTHONDONTWRITEBYTECODE", None)  # what pip installs has its byte code
    run_of, before = about(), read_stated(STATED)
    with threadpool_limits(1):
        results = measured(wanted.headings or list(BENCHES), wanted.quick)
    stated = [result for part in before.results.values() for result in part]
    print("\n".join(worse((result for part in results.values() for result in part), stated)))
    if not wanted.quick:
        now = beside_stated(run_of, results, before)
        STATED.write_bytes(msgspec.json.format(msgspec.json.encode(now), indent=1))
        PAGE.write_text(page(now), "utf-8")


if __name__ == "__main__":
    main()
