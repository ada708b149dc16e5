"""When will the frequency be 2 % lower? The forecast of a series from a CSV file: `forecast_csv.py FILE`.

Rows of days and hertz below a heading. Without a file it writes one first: twelve months of a spindle that wears.
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
first, probable, last = ahead.reached(level)
print(f"{level:.0f} Hz: between day {first:.0f} and {last:.0f} (80 %), probably day {probable:.0f}")
plt.plot(days, frequency, "o")
plt.plot(ahead.dates, ahead.line)
plt.fill_between(ahead.dates, ahead.fan(0.1), ahead.fan(0.9), alpha=0.3)
plt.axhline(level, color="black", linewidth=0.8)
plt.gca().set(xlabel="day", ylabel="natural frequency (Hz)")
plt.savefig("forecast_csv.png", dpi=100)
