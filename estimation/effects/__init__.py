"""Physical effects, one file each."""
