"""``python -m underlay``: the command line."""

from underlay.cli import main

if __name__ == "__main__":
    main()
