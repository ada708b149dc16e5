"""Stiffness and damping of bearings and joints from measured modes."""
