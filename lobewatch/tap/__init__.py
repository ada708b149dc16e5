"""Live tap test: device connection, hits, self-check, state, result and emulated devices."""
