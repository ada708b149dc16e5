"""Joints and bearings found from several tools, for people and as JSON."""
