"""What a person adds to the journal beside tap tests: events, exclusions, test cuts."""
