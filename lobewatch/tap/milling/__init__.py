"""An emulated cut: how the spindle at speed differs from the one that was tapped, and what its housing sounds like."""
