"""mjbots moteus brushless controller, through an fdcanusb."""
