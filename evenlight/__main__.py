"""`python -m evenlight` is the command `evenlight`."""

from evenlight.command import main

if __name__ == "__main__":
    main()
