"""What test cuts teach, as people call it."""

from __future__ import annotations

NAMES = {
    "tangential": "Kt",
    "ratio": "Kr/Kt",
    "frequency_x": "f_n in x",
    "frequency_y": "f_n in y",
    "damping_x": "zeta in x",
    "damping_y": "zeta in y",
    "stiffness_x": "K in x",
    "stiffness_y": "K in y",
}
"""Of what is learnt."""
