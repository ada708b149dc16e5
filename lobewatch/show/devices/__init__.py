"""Ports, devices and sensors for people and as JSON."""
