"""The modes of a file for people: table, remarks, JSON."""
