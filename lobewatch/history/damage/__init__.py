"""Tap tests whose files are damaged: left out, said, and nothing is stable where a newer one is lost."""
