"""What has happened to a machine: tap tests, exclusions, events, as a table, CSV and JSON."""
