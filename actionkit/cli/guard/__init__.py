"""Commands for programs that are killed: `guard` and `leftovers`."""
