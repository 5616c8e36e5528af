"""What the reference servers do with their goals."""
