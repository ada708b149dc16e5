"""Cuts heard live: the accelerometer on the housing, from the air before a cut to the air after it."""
