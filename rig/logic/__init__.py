"""The logger board's logic in this computer, behind it a drive."""
