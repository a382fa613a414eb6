"""ATI digital force/torque sensor over RS-485: Modbus to set up, then a bare stream."""
