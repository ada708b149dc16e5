"""Setup questions of a new machine, and what their answers make of machine.toml."""
