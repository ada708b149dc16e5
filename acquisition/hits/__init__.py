"""Capture single hits from a stream of scans and split them into rest, pulse and decay."""
