"""Goals of any client: which there are, what state they are in, and who serves them."""
