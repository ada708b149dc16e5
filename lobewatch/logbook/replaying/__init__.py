"""Recorded files as tap tests of a machine: found in folders, dated, understood, shown or stored."""
