"""What befalls an emulated spindle: how its bearings wear, and what moves its frequency from test to test."""
