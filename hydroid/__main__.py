"""`python -m hydroid`: the command line."""

from hydroid.cli.app import main

main()
