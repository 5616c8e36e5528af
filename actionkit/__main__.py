"""``python -m actionkit``: the command line, as the command ``actionkit``."""

from actionkit.cli import main

if __name__ == "__main__":
    main()
