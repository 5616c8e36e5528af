"""The log and the observers of every goal's transitions."""
