"""Commands about types: `interfaces` (build your own) and `stubs` (for type checkers)."""
