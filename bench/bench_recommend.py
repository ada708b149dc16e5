"""CPU time of a recommended setting compared with one verdict on a program, in one run on one BLAS thread.

.venv/bin/python bench/bench_recommend.py
"""

from __future__ import annotations

import time
from datetime import UTC, datetime

import numpy as np
from threadpoolctl import threadpool_limits

from lobewatch.machine import Machine, ProgramTable
from lobewatch.machine.settings.machine_file import parse_machine_file
from lobewatch.tool.assembly import Assembly
from lobewatch.verdicts.program_case import NO_TEST_CUTS
from lobewatch.verdicts.recommendation import recommend
from lobewatch.verdicts.verdict import evaluate_program
from modal import Mode

MACHINE: Machine = parse_machine_file('[machine]\nname = "bench"\n[speed]\nlow_rpm = 1500\nhigh_rpm = 24000\n')
DIAMETER = 20.0
"""Tool diameter (mm)."""


def assembly(modes: int) -> Assembly:
    """A tool with so many modes in each direction, those in y 6 % higher."""
    middles = np.geomspace(700, 700 * 1.45 ** (modes - 1), modes)
    x, y = ([Mode(f * share, 0.03, 4e7 * (f / 700) ** 0.5) for f in middles.tolist()] for share in (1.0, 1.06))
    return Assembly("reference", datetime(2026, 1, 1, tzinfo=UTC), "bench", x, y, ("x", "y"), None, {}, False, ())


def cut(immersion: float, teeth: int) -> ProgramTable:
    """A cut in steel, fed in all directions."""
    return ProgramTable(
        name="bench",
        teeth=teeth,
        radial_depth_mm=immersion * DIAMETER,
        tool_diameter_mm=DIAMETER,
        direction="down",
        tangential_n_per_mm2=1600,
        radial_n_per_mm2=600,
        helix_deg=30,
        speed_rpm=8000,
        depth_mm=0.5,
    )


def seconds(modes: int, immersion: float, teeth: int, either: bool) -> tuple[float, float]:
    """CPU time (s) of a recommendation, and of the verdict on one program."""
    table, tool = cut(immersion, teeth), assembly(modes)
    begin = time.process_time()
    answer = recommend(table, tool, MACHINE, NO_TEST_CUTS, either)
    end = time.process_time()
    evaluate_program(answer.program, tool, MACHINE)
    return end - begin, time.process_time() - end


def main() -> None:
    """Print the table."""
    print("| modes a direction | a/D | teeth | milled | recommendation (s) | one verdict (s) |\n" + "|---" * 6 + "|")
    for modes, immersion, teeth, either in (
        (1, 1.0, 4, False),
        (2, 1.0, 4, False),
        (2, 0.25, 4, False),
        (2, 0.25, 4, True),
        (6, 1.0, 4, False),
        (6, 0.25, 4, False),
        (6, 0.05, 2, False),
    ):
        ours, peer = seconds(modes, immersion, teeth, either)
        row = (modes, immersion, teeth, "both" if either else "down", f"{ours:.1f}", f"{peer:.2f}")
        print("|", " | ".join(map(str, row)), "|", flush=True)


if __name__ == "__main__":
    with threadpool_limits(1):
        main()
