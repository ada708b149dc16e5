"""What test cuts teach of the turning spindle: prior, likelihood, weighted draws, and the next cut worth making."""
