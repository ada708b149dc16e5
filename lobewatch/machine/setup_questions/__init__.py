"""Setup questions of a new machine, and machine.toml from their answers."""
