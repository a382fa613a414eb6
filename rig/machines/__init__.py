"""What a session moves, what is read of it, and within which limits."""
