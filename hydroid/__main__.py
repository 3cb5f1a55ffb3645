"""`python -m hydroid`: the command line."""

from hydroid.commands.app import main

main()
