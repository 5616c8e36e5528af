"""The errors of calls and their texts."""
