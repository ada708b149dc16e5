"""Bearing stiffness from a measured frequency with its error: 95 % intervals, and how often they hold the truth."""

from importlib import resources

import matplotlib.pyplot as plt
import numpy as np

from dsm import calibrate, natural_frequencies
from lobewatch.machine.settings.machine_file import parse_machine_file

machine = parse_machine_file(resources.files("sim_data").joinpath("surrogate_machine.toml").read_text("utf-8"))
true = machine.model("reference")
stiffness, frequency = true.bearings[0].stiffness, float(natural_frequencies(true, 1)[0])
random = np.random.default_rng(1)
errors = np.array([0.05, 0.2, 0.5, 1.0, 2.0])  # % of the frequency; reclamping the tool changes it by 0.1 to 0.3 %
for number, error in enumerate(errors):
    std = error / 100 * frequency
    found = [calibrate(true, frequency + random.normal(scale=std), std) for _ in range(100)]
    ends = np.array([result.bearing_stiffness_interval for result in found], dtype=float)
    held = np.mean((ends[:, 0] <= stiffness) & (stiffness <= ends[:, 1]))
    values = np.array([result.bearing_stiffness for result in found])
    scatter = 100 * np.std(values) / stiffness
    print(f"f_1 within {error:g} %: stiffness within {scatter:.1f} %, 95 % interval held {held:.0%}")
    plt.errorbar(
        number + np.linspace(-0.3, 0.3, 20),
        values[:20] / 1e6,
        np.abs(ends[:20].T - values[:20]) / 1e6,
        fmt=".",
        color="tab:blue",
    )
plt.axhline(stiffness / 1e6, color="black", linewidth=0.8)
plt.xticks(range(len(errors)), [f"{error:g} %" for error in errors])
plt.gca().set(xlabel="standard error of f_1", ylabel="bearing stiffness (N/um), 95 % intervals")
plt.savefig("calibration_study.png", dpi=100)
