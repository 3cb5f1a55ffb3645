"""The command line: one thin function for each function of `hydroid.api`."""
