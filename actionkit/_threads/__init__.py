"""Time, waiting, and the threads on which the user's functions run."""
