"""The log format: one run as an MCAP file of fixed-layout ROS 2 messages."""
