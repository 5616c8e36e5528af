"""A client closes, or the process ends or forks: its calls end, and all is freed."""
