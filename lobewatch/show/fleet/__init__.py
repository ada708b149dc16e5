"""Presentation and export of many machines."""
