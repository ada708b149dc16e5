"""Whether the files of a machine are those that were committed; damage by name, and its mending."""
