"""Share of 80 % forecast ranges that hold the date, on public lives of machines.

`forecast_lives.py train_FD001.txt Anomaly_Detection_Dataset.csv`: engines of NASA C-MAPSS (sensor 11 of units 2, 5, 8,
...) and rms and mean of bearing 1 in set 2 of the IMS bearing data, as features of each record.
"""

import sys
from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import median_filter, uniform_filter1d
from scipy.optimize import isotonic_regression

from lobewatch.monitoring.forecast import MIN_FORECAST_POINTS, forecast_series

Floats = NDArray[np.float64]
Case = tuple[Floats, Floats, float, float]
"""Dates and values of the tests so far, a level, and the date at which it is reached."""
SENSOR_COLUMN = 15
"""Column of sensor 11 in the table of the engines."""
AHEAD = (0.2, 0.4, 0.6, 0.85)
"""Times ahead of the forecasts of each engine, in times elapsed."""
IMS_LEVELS = (5, 10, 15, 20, 25, 30, 40, 50, 60, 75, 100)
"""Rises of the bearing (100 ln) whose dates are looked for."""
IMS_VISIBLE = 3.0
"""Rise (100 ln) from which on the bearing is forecast."""


def reached(dates: Floats, falling: Floats, level: float) -> float:
    """Return the first date at which a falling line is at a level."""
    i = int(np.argmax(falling <= level))
    return float(np.interp(level, falling[[i, i - 1]], dates[[i, i - 1]]))


def engine_cases(path: str, every: int) -> Iterator[Case]:
    """Yield four forecasts of the end of each engine, tested every few cycles."""
    rows = np.loadtxt(path)
    for unit in range(2, 101, 3):
        life = rows[rows[:, 0] == unit]
        if not life.size:
            continue
        dates, y = life[:, 1], -100 * np.log(life[:, SENSOR_COLUMN] / life[0, SENSOR_COLUMN])
        line = isotonic_regression(uniform_filter1d(y, 11), increasing=False).x
        truth = reached(dates, line, float(line[-1]) + 1e-9)
        ends = {
            int(np.searchsorted(dates[::every], dates[0] + (truth - dates[0]) / (1 + ahead), "right"))
            for ahead in AHEAD
        }
        for end in sorted(ends):
            if end >= MIN_FORECAST_POINTS and truth > dates[::every][end - 1]:
                yield dates[::every][:end], y[::every][:end], float(line[-1]) + 1e-9, truth


def bearing_cases(path: str, column: int, tests: int) -> Iterator[Case]:
    """Yield forecasts of the bearing, 15 to 90 % of the elapsed time ahead."""
    values = np.genfromtxt(path, delimiter=",", skip_header=1, usecols=[column])
    dates, y = np.arange(values.size, dtype=np.float64), -100 * np.log(values / values[:20].mean())
    line = np.minimum.accumulate(median_filter(y, 9))
    picked = np.linspace(0, y.size - 1, tests).round().astype(int)
    for level in -np.array(IMS_LEVELS, dtype=float):
        truth = reached(dates, line, level)
        for end in range(MIN_FORECAST_POINTS, tests + 1):
            last = picked[end - 1]
            if last and 0.15 <= (truth - last) / last <= 0.9 and level < line[last] <= -IMS_VISIBLE:
                yield dates[picked[:end]], y[picked[:end]], float(level), truth


def main(engines: str, bearing: str) -> None:
    """Print the shares of each record."""
    studies = {
        "engines, every 5 cycles": engine_cases(engines, 5),
        "engines, every 10 cycles": engine_cases(engines, 10),
        "IMS set 2, rms, 62 tests": bearing_cases(bearing, 5, 62),
        "IMS set 2, rms, 40 tests": bearing_cases(bearing, 5, 40),
        "IMS set 2, mean, 62 tests": bearing_cases(bearing, 1, 62),
    }
    for name, cases in studies.items():
        sides = []
        for dates, y, level, truth in cases:
            earliest, _, latest = forecast_series(dates, y, 3 * dates[-1] + 1).crossing_dates(level)
            sides.append((earliest <= truth <= latest, truth < earliest, truth > latest))
        inside, earlier, later = 100 * np.mean(sides, axis=0)
        print(f"{name}: {len(sides)} forecasts, inside {inside:.0f} %, earlier {earlier:.0f} %, later {later:.0f} %")


if __name__ == "__main__":
    main(*sys.argv[1:])
