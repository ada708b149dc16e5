"""What stands beside the word on a cutting program: the doubt it was judged over, and settings that are safe."""
