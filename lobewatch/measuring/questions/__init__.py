"""Recordings that are implausible for a machine: what is asked of a person, and what was answered."""
