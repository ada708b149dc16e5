"""Figures 8 and 10 of Gaber & Hashemi (2015): bearing stiffness for a frequency, and the lobes before and after.

Figure 10 with K as the paper has it, K times 0.9 for a frequency times 0.9, and with K of the recalibrated model.
"""

from importlib import resources

import matplotlib.pyplot as plt
import numpy as np

from dsm import calibrate, modal_stiffness, stiffness_curve
from lobes import Cut, age_mode, zero_order_lobes
from lobewatch.machine.settings.machine_file import parse_machine_file
from modal import Mode

machine = parse_machine_file(resources.files("sim_data").joinpath("surrogate_machine.toml").read_text("utf-8"))
spindle = machine.model("reference")
frequency = np.linspace(400, 2250, 150)
figure, (left, right) = plt.subplots(1, 2, figsize=(11, 4), layout="constrained")
left.semilogx(stiffness_curve(spindle, frequency), frequency)
left.set(xlabel="bearing stiffness (N/m)", ylabel="natural frequency f_1 (Hz)")

measured = Mode(1722.0, 0.029136, 3.2289e7)  # table of the paper
new, old = calibrate(spindle, 1722.0).spindle, calibrate(spindle, 0.9 * 1722.0).spindle
softer = modal_stiffness(old) / modal_stiffness(new)
slot = Cut(teeth=2, immersion=1.0, direction="down", tangential=800e6, radial=240e6)
speeds = np.linspace(2000, 16_000, 1000)
lowest = []
for mode, style, name in (
    (measured, "k--", "as measured"),
    (age_mode(measured, 0.9, "paper"), "tab:red", "f x 0.9, K x 0.9 (paper)"),
    (age_mode(measured, 0.9, "model", softer), "tab:blue", f"f x 0.9, K x {softer:.3f} (model)"),
):
    limit = zero_order_lobes([mode], [mode], slot, speeds)
    lowest.append(limit.minimum.depth)
    right.plot(speeds, limit.depth * 1e3, style, label=name)
right.set(xlabel="spindle speed (rpm)", ylabel="deepest stable slot (mm)", ylim=(0, 6))
right.legend()
figure.savefig("paper_figures.png", dpi=100)
print(f"lowest limit over that as measured: paper {lowest[1] / lowest[0]:.4f}, model {lowest[2] / lowest[0]:.4f}")
