"""Numbers printed in the paper, the only ones of the comparison that are not computed.

O. Gaber and S. M. Hashemi, Effects of machine tool spindle decay on the stability lobe diagram: an
analytical-experimental study, Shock and Vibration 2016, 4390185.
"""

SEGMENTS = 26
"""Uniform segments of the model, Fig. 3."""
BEARINGS = 10
"""Bearings of the model, Fig. 3."""
RIGID_FREQUENCY = 2303.0
"""First natural frequency with rigid bearings, by dynamic stiffness (Hz)."""
FEM_ELEMENTS = 154
"""Elements (BEAM188) of the finite-element model."""
FEM_FREQUENCY = 2367.0
"""First natural frequency with rigid bearings, by finite elements (Hz)."""
RIGID_EXCESS = 34.0
"""Excess of the frequency with rigid bearings over the measured one (%)."""
FREQUENCY = 1722.0
"""First natural frequency, measured (Hz)."""
BEARING_STIFFNESS = 1.28e9
"""Stiffness of each bearing that gives this frequency, Fig. 8 (N/m)."""
OLD_FREQUENCY = 1550.0
"""First natural frequency after the assumed drop of 10 % (Hz)."""
OLD_BEARING_STIFFNESS = 7.72e8
"""Stiffness of each bearing after the drop (N/m)."""
RIGID_CRITICAL_SPEED = 138464.0
"""Critical speed with rigid bearings, Fig. 7 (rpm)."""
CRITICAL_SPEED = 103142.0
"""Critical speed with calibrated bearings, Fig. 9 (rpm)."""
DAMPING_RATIO = 0.029136
"""Damping ratio of the measured mode, by (28) (-)."""
STIFFNESS = 3.2289e7
"""Stiffness K_exp of the measured mode, by (29) (N/m)."""
OLD_STIFFNESS = 2.90601e7
"""Stiffness K_theo of the old spindle, attributed to (30) to (36) (N/m)."""
