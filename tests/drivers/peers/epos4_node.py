"""A drive's fake on canopen's server as a process of its own, on a multicast bus in real time.

    python -m tests.drivers.peers.epos4_node CHANNEL PORT

Prints a line when it is on the bus. Every other line on standard input is an error code in
hexadecimal that the drive then has.
"""

import select
import sys
from time import monotonic

import can

from drivers.epos4.fake import Epos4Fake
from drivers.transport.can_bus import CanFrame


def main() -> None:
    channel, port = sys.argv[1], int(sys.argv[2])
    bus = can.Bus(interface="udp_multicast", channel=channel, port=port, fd=False)
    drive = Epos4Fake()
    began_s, ticks = monotonic(), 0
    sys.stdout.write("ready\n")
    sys.stdout.flush()
    while True:
        message = bus.recv(0.0005)
        if message is not None:
            data = bytes(message.data)
            drive.receive(CanFrame(message.arbitration_id, data, message.is_extended_id))
        due = int((monotonic() - began_s) * 1000)
        drive.advance(due - ticks)
        ticks = due
        if select.select([sys.stdin], [], [], 0)[0]:
            line = sys.stdin.readline()
            if not line:
                return
            drive.fail(int(line, 16))
        for frame in drive.transmit():
            bus.send(
                can.Message(
                    arbitration_id=frame.can_id, data=frame.data, is_extended_id=frame.extended
                )
            )


if __name__ == "__main__":
    main()
