"""Master of the 3-DOF grasper: three potentiometers on a Teensy's converter."""
