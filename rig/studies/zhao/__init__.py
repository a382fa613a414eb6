"""Zhao and Nelson 2016, forces of simulated graspers, made again: study and page."""
