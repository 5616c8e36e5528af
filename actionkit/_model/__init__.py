"""What users hold and set: states, outcomes, errors, settings."""
