"""Protocols: which runs a campaign has, their trajectories, and the shipped protocol files."""
