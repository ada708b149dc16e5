"""Capture of single hits from a stream of scans: trigger, force pulse and free decay."""
