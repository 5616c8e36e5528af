"""Tools for tests and for `actionkit doctor`."""
