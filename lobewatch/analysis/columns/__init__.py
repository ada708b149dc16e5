"""Columns of history.h5 that are more than a value a row."""
