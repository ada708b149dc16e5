"""Public files of other programs: which two commands read each, and what is found in it.

    python bench/public_files.py FOLDER

Nothing is fetched: FOLDER holds copies of the public repositories, each as FOLDER/OWNER/NAME; what is not there is
skipped. Prints the table of docs/studies/public-files.md. The first command has
the name of the file only, the second has the answers.
"""

from __future__ import annotations

import json
import shlex
import sys
import textwrap
from dataclasses import dataclass
from pathlib import Path

from typer.testing import CliRunner

from lobewatch.cli import app

MOST_FOUND = 3
"""Frequencies that are told of a file."""
MOST_SAID = 110
"""Characters of a message."""


@dataclass(frozen=True)
class PublicFile:
    """One file, or several that were written alike."""

    pattern: str
    """Path in FOLDER, or a pattern."""
    answers: str = ""
    """Options that answer what the file does not say; a word that begins with @ is a path in FOLDER."""

    def words(self, folder: Path) -> list[str]:
        """The options, word by word."""
        return [str(folder / word[1:]) if word.startswith("@") else word for word in shlex.split(self.answers)]


@dataclass(frozen=True)
class Reading:
    """Result of a command on a file."""

    modes: tuple[tuple[float, bool], ...]
    """Frequency (Hz) of each mode, and whether it is trusted."""
    refusal: str
    """Message where it was not read; else empty."""

    @property
    def trusted(self) -> list[float]:
        """Frequencies of the modes that are trusted (Hz)."""
        return [frequency for frequency, is_trusted in self.modes if is_trusted]


DYNAMICS = "leekunhwee/Dynamics/Cutting/Stability"
SIGNALS = "leekunhwee/Vibration-Signal-Processing"
WING = "Renkinios/MECA0062-1_vibration_testing/data"
PLATE = "kobyhuazai/Vibration"
TESTING = "Vibration-Testing/vibrationtesting/vibrationtesting/data"
BLADE = "csatobalint/modal_analysis_hw/blade_measurements"
HAMMER = "Sidwrittenallover/Experimental_Modal_Analysis/data"
VIBROMETER = "joaonunovalente/vibrometer-analysis"
OLD_TESTING = "Vibration-Testing/Vibration-Testing-Matlab"
SHM = "High-Rate-SHM-Working-Group"
PLATE_FRF = "MAT_001_FRF_Channel_8"
PLATE_POINTS = "WangSuhan/Modal-identification-of-plate/20201016"
DYNAMIC_STRUCTURE = "TimVrtac/Impact-testing-DS/test_DS"
HIT_AXES = "--axes hits,channels,samples"
CHANNELS = '--columns "time [s],acceleration [g],time [s],force [N]"'
FILES = (
    PublicFile(f"{DYNAMICS}/FrequencyDomain/Milling/General/FRF[XY].frf"),
    PublicFile(f"{DYNAMICS}/TimeDomain/SemiDis/Milling/[XY].frf"),
    PublicFile(f"{DYNAMICS}/FrequencyDomain/Milling/FRF.mat", "--response 1 --unit m/N --spacing 1"),
    PublicFile(
        f"{DYNAMICS}/FrequencyDomain/Turning/Two DOF Example/FRF.mat",
        '--columns "frequency [rad/s]=w,frf=FRF" --unit m/N',
    ),
    PublicFile(f"{SIGNALS}/FRFGeneration/H00.mat", '--columns "real=H00:1,imag=H00:2" --unit m/N --spacing 0.5'),
    PublicFile(f"{SIGNALS}/FRFGeneration/H2.mat", '--columns "real=H21:1,imag=H21:2" --unit m/N --spacing 1'),
    PublicFile(f"{SIGNALS}/ExperimentalModalAnalysis/Point_*.txt", '--columns "frequency,real [m/N],imag"'),
    PublicFile(f"{SIGNALS}/ImpactTesting/*.txt", '--columns "time [s],force [N],acceleration [m/s^2]"'),
    PublicFile("alxhslm/ModeLAB/Example/SignalCalc/ASCII*/Hxysv*.txt"),
    PublicFile(
        "alxhslm/ModeLAB/Peak fitting/RFP Method/FRF.mat",
        '--columns "frequency [rad/s]=FRF:1,frf=FRF:2" --unit m/N',
    ),
    PublicFile(
        "alxhslm/ModeLAB/Peak fitting/RFP Method/FRF_noise.mat",
        '--columns "frequency [rad/s]=FRF_noise:1,frf=FRF_noise:2" --unit m/N',
    ),
    PublicFile(f"{PLATE}/accel-pt8.txt", f"{CHANNELS} --force @{PLATE}/impact_pt8.txt"),
    PublicFile(f"{PLATE}/accel-pt18.txt", f"{CHANNELS} --force @{PLATE}/impact_pt18.txt"),
    PublicFile(f"{WING}/first_lab/DPsv0000*.mat", "--response 1 --hit-at 0"),
    PublicFile(f"{WING}/sec_lab/DPsv0000*.mat", "--response 1 --hit-at 0"),
    PublicFile(f"{TESTING}/case[12].mat", "--unit m/s^2/N"),
    PublicFile(f"{TESTING}/mckiddat.mat", "--response 1 --unit m/N"),
    PublicFile(f"{TESTING}/testdata.mat", '--columns "time [s]=t,force [N]=xn,acceleration [g]=yn"'),
    PublicFile(f"{DYNAMIC_STRUCTURE}/F?.npy", f'{HIT_AXES} --columns "force [N],acceleration [g],-,-" --rate 20000'),
    PublicFile(
        "TimVrtac/Impact-testing-v2/series_meas/?.npy",
        f'{HIT_AXES} --columns "force [N],acceleration [g],-" --rate 51200',
    ),
    PublicFile(f"{BLADE}/K?_H221.txt"),
    PublicFile(f"{BLADE}/M1[13][268].txt"),
    PublicFile(f"{BLADE}/M110.txt", '--sensitivity "10.2 mV/g"'),
    PublicFile(f"{HAMMER}/imp_ham_set?_no*mass.CSV", '--columns "time [s],acceleration [cm/s^2],-,-,-,force [N]"'),
    PublicFile(f"{HAMMER}/[Ii]mp_ham_calib_set?.CSV", '--columns "time [s],acceleration [cm/s^2],force [N]"'),
    PublicFile(
        f"{VIBROMETER}/*reflection/data/N?_*.mat",
        '--response 1 --unit V/V --sensitivity "23.65 mV/N,10.79 mV/(m/s^2)"',
    ),
    PublicFile(
        f"{VIBROMETER}/*EGS*/data/medida?.mat",
        '--response 1 --unit V/V --sensitivity "23.65 mV/N,10.79 mV/(m/s^2)"',
    ),
    PublicFile(f"{VIBROMETER}/*/measurements/*.vna", "--response 1"),
    PublicFile("vibrationtoolbox/vtoolbox/vtb7_3_?.mat", "--unit m/s^2/N"),
    PublicFile("vibrationtoolbox/vtoolbox/vtb7_2ex.mat", '--columns "force [N]=f,displacement [m]=x" --rate 1000'),
    PublicFile(
        f"{PLATE_POINTS}/*.mat",
        f'--columns "frequency [Hz]={PLATE_FRF}:1,frf={PLATE_FRF}:2" --unit m/s^2/N',
    ),
    PublicFile("torebutlin/pydvma/data/examples/ruler_grid_acc_3.mat", "--response 1 --unit m/s^2/N"),
    PublicFile(f"{OLD_TESTING}/freqdemo.mat", '--columns "frequency [Hz]=w,frf=ts" --unit m/N'),
    PublicFile(f"{OLD_TESTING}/vtestingdata1.mat", '--columns "time [s]=t,force [N]=y:1,displacement [m]=y:2"'),
    PublicFile(f"{OLD_TESTING}/hkdat1.mat"),
    PublicFile("KIT-FAST/modalAnalysis-OMA-EMA/modalAnalysis/records/EMA_records_demo.mat", "--response 1 --unit m/N"),
    PublicFile(
        "ual-arm/vibration-test-matlab/vib-test-toolkit/*.mat",
        '--columns "frequency [Hz]=DATOS:1,frf=DATOS:2" --unit m/s^2/N',
    ),
    PublicFile("KuanHsienn/Vibrometer-Plotter/*.uff"),
    PublicFile(f"{SHM}/Dataset-7-forced-vibration-and-shock/data/testset-B/*/*/*.lvm"),
    PublicFile(f"{SHM}/Dataset-11-*/Data/*/*.lvm", '--skip 1 --columns "time [s]=1,force [N]=2,acceleration [g]=3"'),
    PublicFile(f"{SHM}/Dataset-5-Extended-Impact-Testing/data/dataset-1/data-1/*/acc_*.txt"),
    PublicFile("OWI-Lab/sdypy_io_tdms/tests/static/good/*.tdms"),
    PublicFile("adamreeve/npTDMS/nptdms/test/data/raw1.tdms"),
    PublicFile("EnriqueGarMac/ModalAnalysis/Class_III_Signal processing/Phyphox/Enrique.csv"),
    PublicFile("JiaxinZhong/PulseLabshop/matlab/data/pls?.txt"),
    PublicFile("Collins-Ogbodo/Experimental-Modal-Analysis/Test/H_simulated.npy"),
)


def read(file: Path, answers: list[str]) -> Reading:
    """One command."""
    result = CliRunner().invoke(app, ["modes", str(file), *answers, "--json"])
    if result.exit_code:
        return Reading((), str(result.exception).replace(f"{file}: ", ""))
    modes = json.loads(result.stdout)["modes"]
    return Reading(tuple((mode["frequency_hz"], mode["trust"] == "trusted") for mode in modes), "")


def row(folder: Path, entry: PublicFile) -> str:
    """Return a row of the table; empty if the file is missing."""
    files = sorted(folder.glob(entry.pattern))
    if not files:
        return ""
    words = entry.words(folder)
    at_once = [read(file, []) for file in files]
    answered = [read(file, words) for file in files] if words else at_once
    first = answered[0]
    found = f"refused: {textwrap.shorten(first.refusal, MOST_SAID)}" if first.refusal else found_text(first)
    n_read = f"{sum(not reading.refusal for reading in answered)} of {len(files)}"
    asked = "nothing" if not at_once[0].refusal else f"`{entry.answers}`" if words else "-"
    return f"| `{entry.pattern}` | {asked.replace('@', '')} | {n_read} | {found} |"


def found_text(reading: Reading) -> str:
    """The modes in a file that was read."""
    first = ", ".join(f"{frequency:.5g}" for frequency in reading.trusted[:MOST_FOUND])
    return f"{len(reading.trusted)} trusted: {first} Hz" if first else "no mode trusted"


def main() -> None:
    """Print the table."""
    if len(sys.argv) != 2 or not Path(sys.argv[1]).is_dir():
        sys.exit("give the folder of the public files: python bench/public_files.py FOLDER")
    print("| files | answered | read | found in the first |\n|---|---|---|---|")
    for entry in FILES:
        if line := row(Path(sys.argv[1]), entry):
            print(line, flush=True)


if __name__ == "__main__":
    main()
