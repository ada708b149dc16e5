"""The parts of the report: first screen, lobes over time, lists, the data of each figure, the page of all machines."""
