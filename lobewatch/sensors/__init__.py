"""Checks of sensors, DAQ and computer before a tap test."""
