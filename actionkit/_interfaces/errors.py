"""The errors of building an interface package."""

from __future__ import annotations


class InterfacesError(Exception):
    """An interface package cannot be built; the text says where, why, and what to do."""


class BadSourceError(InterfacesError):
    """Something in the package's own files is wrong; one line for each place."""


class MissingToolError(InterfacesError):
    """A compiler, Python.h or a generator is missing."""
