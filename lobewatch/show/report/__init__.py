"""The report: its page, its sections, the data of its figures; the page of all machines."""
