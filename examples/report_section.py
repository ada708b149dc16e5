"""A section of one's own in the report: how hard the spindle was hit.

It makes two months of the demo, adds the section behind the others, and writes report.html.
"""

import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path

from lobewatch import Logbook
from lobewatch.show.report.report import write_report
from lobewatch.show.report.report_data import ReportData
from lobewatch.show.report.section import DataTable, Section
from lobewatch.show.report.sections import SECTIONS


def hammer_forces(material: ReportData) -> Sequence[Section]:
    """Return a table of the peak forces of the newest tap test."""
    peaks = [f"{hit.force.max():.0f}" for hit in material.newest.accepted]
    rows = [[str(number), peak] for number, peak in enumerate(peaks, 1)]
    return [Section("Hammer", [DataTable(["hit", "peak force (N)"], rows)])]


machine = Path("mill")
subprocess.run([sys.executable, "-m", "lobewatch.cli", "demo", "--out", machine, "--taps", "2"], check=True)
print(write_report(Logbook.open(machine), Path("report.html"), sections=[*SECTIONS, hammer_forces]))
