"""One call: its goal is sent, perhaps again, until the call has ended."""
