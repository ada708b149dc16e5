"""Every recorded file of a folder (UFF, MATLAB, LVM) as one table of modes: `folder_to_table.py FOLDER [UNIT]`.

What cannot be read gets a line that says why. Without a folder it reads the recordings that the tests use. UNIT is that
of FRFs in files that do not say it.
"""

import csv
import sys
from pathlib import Path

from acquisition import DataError, Description, inspect_file
from acquisition.files.read_recording import read_frf
from modal import Mode, fit_modes


def modes_of(path: Path, unit: str) -> list[Mode]:
    """Return the modes of a file. Raise DataError or ValueError if it has none."""
    asked = inspect_file(path).problems
    return fit_modes(read_frf(path, Description(unit=unit) if asked else Description()))


folder = Path(sys.argv[1]) if len(sys.argv) > 1 else Path(__file__).parents[1] / "tests" / "data"
unit = sys.argv[2] if len(sys.argv) > 2 else "m/s^2/N"
files = sorted(path for path in folder.rglob("*") if path.suffix.lower() in (".uff", ".unv", ".mat", ".lvm"))
with_modes = 0
with Path("modes.csv").open("w", newline="", encoding="utf-8") as file:
    table = csv.writer(file)
    table.writerow(["file", "frequency_hz", "damping_ratio", "stiffness_n_per_m", "remark"])
    for path in files:
        try:
            modes = modes_of(path, unit)
        except (DataError, ValueError) as error:
            table.writerow([path.name, "", "", "", str(error).removeprefix(f"{path}: ")])
            continue
        with_modes += 1
        for mode in modes:
            values = f"{mode.frequency:.6g}", f"{mode.damping_ratio:.4g}", f"{mode.stiffness:.5g}"
            table.writerow([path.name, *values, " ".join(remark.code for remark in mode.remarks)])
print(f"modes.csv: {with_modes} of {len(files)} files have modes")
