"""What servers say about goals: status, feedback, and the codes in answers."""
