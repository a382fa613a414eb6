"""Robotiq FT 300 and FT 300-S force and torque sensors over RS-485."""
