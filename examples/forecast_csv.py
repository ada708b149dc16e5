"""Forecast when the frequency will be 2 % lower, from a series in a CSV file: `forecast_csv.py FILE`.

The file has rows of days and Hz below a heading. Without a file, the program writes one: twelve months of a wearing
spindle.
"""

import sys
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

from lobewatch.monitoring.forecast import forecast_series

path = Path(sys.argv[1]) if len(sys.argv) > 1 else Path("series.csv")
if len(sys.argv) < 2:
    days = 30.0 * np.arange(12)
    scatter = np.random.default_rng(1).normal(scale=0.8, size=12)
    rows = np.column_stack((days, 1713 * (1 - 1e-4 * days) + scatter))
    np.savetxt(path, rows, "%.2f", ",", header="day,frequency_hz", comments="")
days, frequency = np.loadtxt(path, delimiter=",", skiprows=1, unpack=True)
ahead = forecast_series(days, frequency, horizon=2 * days[-1])
level = 0.98 * frequency[-1]
dates = ahead.crossing_dates(level)
print(
    f"{level:.0f} Hz: between day {dates.earliest:.0f} and {dates.latest:.0f} (80 %), probably day {dates.probable:.0f}"
)
plt.plot(days, frequency, "o")
plt.plot(ahead.dates, ahead.mean_line)
plt.fill_between(ahead.dates, ahead.quantile_line(0.1), ahead.quantile_line(0.9), alpha=0.3)
plt.axhline(level, color="black", linewidth=0.8)
plt.gca().set(xlabel="day", ylabel="natural frequency (Hz)")
plt.savefig("forecast_csv.png", dpi=100)
