"""`python -m sim` is the program `cmpc`."""

import sys

if __name__ == "__main__":
    try:
        from sim.cli import entry_point
    except KeyboardInterrupt:  # before there is anything to stop
        print("cmpc: interrupted", file=sys.stderr)
        sys.exit(130)
    entry_point()
