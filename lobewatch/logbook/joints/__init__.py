"""Joints and bearings together, from the newest tap tests of several tools."""
