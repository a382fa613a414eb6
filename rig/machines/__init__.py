"""What a session moves: the reference rig's spindle, or the motors of the 3-DOF grasper."""
