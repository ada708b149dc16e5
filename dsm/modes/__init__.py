"""Natural modes, proved complete: frequencies, shapes, energy, damping, whirl."""
