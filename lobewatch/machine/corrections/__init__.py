"""What a person adds to the journal afterwards: maintenance events, and tap tests taken out of the series and back."""
