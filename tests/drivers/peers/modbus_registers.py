"""pymodbus' serial server with given registers, as a process of its own.

python -m tests.drivers.peers.modbus_registers PORT BAUD_RATE SLAVE < registers as JSON
"""

import json
import sys

from pymodbus.server import StartSerialServer
from pymodbus.simulator import DataType, SimData, SimDevice


def main() -> None:
    port, baud_rate, slave = sys.argv[1], int(sys.argv[2]), int(sys.argv[3])
    words = json.load(sys.stdin)
    data = SimData(0, values=words, datatype=DataType.REGISTERS)
    sys.stdout.write("ready\n")
    sys.stdout.flush()
    StartSerialServer(SimDevice(slave, data), port=port, baudrate=baud_rate)


if __name__ == "__main__":
    main()
