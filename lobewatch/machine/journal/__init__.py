"""The journal and its lines: tap tests, events, exclusions, test cuts; each line proves the one before it."""
