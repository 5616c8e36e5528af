"""What a model may send as a goal: limits, checks and their texts."""
