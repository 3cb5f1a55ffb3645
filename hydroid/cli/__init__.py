"""The command line: thin covers of the functions in `hydroid.jobs`."""
