"""A rig without a logger board: the board's logic in this computer, before a drive on CANopen."""
