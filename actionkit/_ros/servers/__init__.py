"""Which servers of an action are there, and whether they are alive."""
