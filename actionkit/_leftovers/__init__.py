"""What is done about goals that a process has left running: they are cancelled or followed."""
