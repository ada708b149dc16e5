"""From a recorded hammer hit to stability lobes, in ten lines."""

from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

from acquisition import estimate_frf, read_hits
from lobes import Cut, zero_order_lobes
from modal import fit_modes

hits = read_hits(Path(__file__).parents[1] / "tests" / "data" / "ladisk_beam" / "acceleration.lvm")
modes = [mode for mode in fit_modes(estimate_frf(hits), hits=hits) if mode.stiffness > 0]
slot = Cut(teeth=2, immersion=1.0, direction="down", tangential=800e6, radial=240e6)
speeds = np.linspace(2000, 30_000, 1500)
limit = zero_order_lobes(modes, None, slot, speeds)
print(f"{len(modes)} modes, lowest limit {limit.minimum.depth * 1e3:.1f} mm at {limit.minimum.speed_rpm:.0f} rpm")
plt.plot(speeds, limit.depth * 1e3)
plt.gca().set(xlabel="spindle speed (rpm)", ylabel="deepest stable slot (mm)", ylim=(0, 100))
plt.savefig("frf_to_lobes.png", dpi=100)
