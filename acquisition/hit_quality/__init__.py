"""Whether a hit is good."""
