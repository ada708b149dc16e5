"""What test cuts have taught, and the next of them, for people and as JSON."""
