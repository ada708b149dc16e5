"""Learning from test cuts: prior, likelihood, posterior samples, and the next test cut."""
