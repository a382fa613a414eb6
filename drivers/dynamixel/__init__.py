"""ROBOTIS Dynamixel X servo drive."""
