"""Natural modes, none missed: frequencies, shapes, energy, damping, whirl."""
