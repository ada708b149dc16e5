"""Rows of the history as bytes, as columns and as diagrams."""
