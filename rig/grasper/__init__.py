"""Kinematics and statics of surgical graspers: three decoupled degrees of freedom, and coupled."""
