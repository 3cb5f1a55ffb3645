"""The run folder: what was asked, how far it came, what came out; and who works in
it."""
