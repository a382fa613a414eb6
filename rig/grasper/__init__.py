"""The 3-DOF grasper: kinematics and statics, its machine and master, and its simulated bench."""
