"""`hydroid` and `python -m hydroid`: the command line,
which may be stopped while it is imported."""

import sys


def main() -> None:
    """Run a command, as `commands.app.main` does."""
    try:
        from hydroid.commands.app import main as run
    except KeyboardInterrupt:
        print("hydroid: stopped; nothing was written", file=sys.stderr)
        sys.exit(130)
    run()


if __name__ == "__main__":
    main()
