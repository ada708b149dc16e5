"""HTML report of a machine or a fleet."""
