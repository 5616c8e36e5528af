"""A signal tells the process to end: its goals are cancelled."""
