"""Modal extraction band by band: find peaks, fit, iterate, refine dense bands."""
