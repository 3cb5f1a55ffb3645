"""Studies: settings that vary, over seeds, on the same logs; every run is one file."""
