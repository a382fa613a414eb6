"""FUTEK QIA128 digital amplifier over UART."""
