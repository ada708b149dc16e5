"""Run the command line by `python -m lobewatch`."""

from lobewatch.cli import main

if __name__ == "__main__":
    main()
