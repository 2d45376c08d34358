"""`python -m sim` is the program `cmpc`."""

from sim.cli import entry_point

if __name__ == "__main__":
    entry_point()
