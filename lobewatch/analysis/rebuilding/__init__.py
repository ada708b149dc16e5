"""The history of a machine worked out anew, by whoever shares the work."""
