"""The values that users get and set: states, outcomes, errors, settings."""
