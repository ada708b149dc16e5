"""TAPS/1, the open frame format for data acquisition boards: protocol, source, emulator and bridge."""
