"""FUTEK USB520 (and USB530) as they come: lines of text."""
