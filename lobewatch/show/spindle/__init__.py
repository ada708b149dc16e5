"""Modes and model of a spindle for people and as JSON."""
