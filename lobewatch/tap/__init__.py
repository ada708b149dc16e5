"""Live tap test: device connection, hits, self-check, state and outcome, and the emulated devices for it."""
