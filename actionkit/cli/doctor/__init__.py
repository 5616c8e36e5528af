"""The command `doctor`: finds out why a call does not work."""
