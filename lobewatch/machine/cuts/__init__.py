"""Test cuts that were heard, by ear or by the accelerometer: lines of the journal, and their recordings."""
