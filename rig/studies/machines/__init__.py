"""Machines that other people built, diagnosed from their published recordings."""
