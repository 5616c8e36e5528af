"""Who is told of every goal's transitions: the log, and observers (contract C6.2)."""
