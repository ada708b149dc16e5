"""The terminal: tables, notes and progress, keys, the operator's screen in characters."""
