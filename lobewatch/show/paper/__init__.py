"""The paper beside lobewatch, for people: one table, its figures drawn anew, a page."""
