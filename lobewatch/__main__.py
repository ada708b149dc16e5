"""Run the command line with `python -m lobewatch`."""

from lobewatch.cli import main

main()
