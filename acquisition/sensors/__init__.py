"""Checks of hammer, accelerometer and DAQ: sample rate, channel skew, mass calibration, plausibility."""
