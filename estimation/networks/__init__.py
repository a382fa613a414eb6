"""Small feed-forward networks: trained with torch, used with NumPy alone."""
