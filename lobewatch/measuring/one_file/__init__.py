"""What `lobewatch modes` makes of one file before and after the fit: which hits count, which windows lie over them."""
