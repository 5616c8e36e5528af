"""The communication thread: its node, its timers, and requests that wait for their turn."""
