"""From hits to an averaged FRF."""
