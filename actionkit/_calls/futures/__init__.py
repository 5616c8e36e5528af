"""What the user holds of a call: its future, its feedback, its goals."""
