"""What a tool tells the model: results, progress, messages and images."""
