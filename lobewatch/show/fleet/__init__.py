"""Many machines at once: a line each, for people and as CSV."""
