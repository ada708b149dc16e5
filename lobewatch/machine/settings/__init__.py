"""machine.toml: its tables, checked, in SI units where something is computed from them."""
