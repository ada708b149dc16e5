"""Tools that were never tapped: predicted from the spindle and a drawing of each, and how deep a slot may be."""

from importlib import resources

import matplotlib.pyplot as plt
import numpy as np

from dsm import MATERIALS, Segment, Spindle, change_tool, modes_at
from lobes import Cut, zero_order_lobes
from lobewatch.machine.settings.machine_file import parse_machine_file
from modal import Mode

DAMPING = 0.03  # of a tool that was tapped in this spindle
machine = parse_machine_file(resources.files("sim_data").joinpath("surrogate_machine.toml").read_text("utf-8"))
spindle = machine.model("reference")


def end_mill(diameter: float, length: float) -> Spindle:
    """Return a carbide end mill (m) in a 36 mm holder, without the spindle; flutes bend like 0.85 of their diameter."""
    flutes = Segment(0.4 * length, 0.85 * diameter, mass_diameter=0.9 * diameter, material=MATERIALS["carbide"])
    shank = Segment(0.6 * length, diameter, material=MATERIALS["carbide"])
    return Spindle([flutes, shank, Segment(0.02, 0.030, end_outer_diameter=0.036)], [])


speeds = np.linspace(4000, 24_000, 800)
for length in (0.060, 0.080, 0.100):
    predicted = change_tool(spindle, 0.0935, end_mill(0.016, length))
    frequency, stiffness = modes_at(predicted, 4)
    modes = [Mode(float(f), DAMPING, float(k)) for f, k in zip(frequency, stiffness, strict=True)]
    slot = Cut(teeth=2, immersion=1.0, direction="down", tangential=796e6, radial=168e6)
    limit = zero_order_lobes(modes, modes, slot, speeds)
    softest = min(modes, key=lambda mode: mode.stiffness * mode.damping_ratio)
    print(
        f"16 mm end mill, {length * 1e3:.0f} mm out: softest mode {softest.frequency:.0f} Hz, "
        f"{softest.stiffness / 1e6:.1f} N/um; a slot of {limit.minimum.depth * 1e3:.2f} mm is stable at any speed"
    )
    plt.plot(speeds, limit.depth * 1e3, label=f"{length * 1e3:.0f} mm out")
plt.gca().set(xlabel="spindle speed (rpm)", ylabel="deepest stable slot (mm)", ylim=(0, 8))
plt.legend(loc="upper left")
plt.savefig("tool_library.png", dpi=100)
