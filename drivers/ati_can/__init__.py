"""ATI's force/torque sensor on CAN (NETCANOEM): its frames, its driver, and the fake."""
