"""What changed between two campaigns of one machine: parameters that moved, effects that came."""
