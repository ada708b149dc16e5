"""Readers of recorded files, which return the contents of a file without interpreting them."""
