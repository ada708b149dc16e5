"""What a recorded file holds, what a person adds to that, and the hits or the FRF that follow from both."""
