"""Tables of machine.toml, checked, in SI units for computation."""
