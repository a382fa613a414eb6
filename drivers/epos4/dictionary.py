"""The objects of a maxon EPOS4 that are used here, in our own words, as `canopen` takes them.

Not the maker's file: ranges and defaults are left out.
"""

from canopen import ObjectDictionary
from canopen.objectdictionary import ODRecord, ODVariable, datatypes

OBJECTS = (
    (0x1000, "Device type", datatypes.UNSIGNED32, "ro"),
    (0x1001, "Error register", datatypes.UNSIGNED8, "ro"),
    (0x1017, "Producer heartbeat time", datatypes.UNSIGNED16, "rw"),
    (0x6007, "Abort connection option code", datatypes.INTEGER16, "rw"),
    (0x603F, "Error code", datatypes.UNSIGNED16, "ro"),
    (0x6040, "Controlword", datatypes.UNSIGNED16, "rw"),
    (0x6041, "Statusword", datatypes.UNSIGNED16, "ro"),
    (0x605E, "Fault reaction option code", datatypes.INTEGER16, "rw"),
    (0x6060, "Modes of operation", datatypes.INTEGER8, "rw"),
    (0x6061, "Modes of operation display", datatypes.INTEGER8, "ro"),
    (0x6064, "Position actual value", datatypes.INTEGER32, "ro"),
    (0x6071, "Target torque", datatypes.INTEGER16, "rw"),
    (0x6076, "Motor rated torque", datatypes.UNSIGNED32, "ro"),
    (0x6077, "Torque actual value", datatypes.INTEGER16, "ro"),
    (0x6502, "Supported drive modes", datatypes.UNSIGNED32, "ro"),
)
RECORDS = {
    0x1016: (("Consumer heartbeat time 1", datatypes.UNSIGNED32, "rw"),),
    0x1018: tuple(
        (name, datatypes.UNSIGNED32, "ro")
        for name in ("Vendor id", "Product code", "Revision number", "Serial number")
    ),
    0x1029: (("Communication error", datatypes.UNSIGNED8, "rw"),),
    0x3001: (
        ("Nominal current", datatypes.UNSIGNED32, "rw"),
        ("Output current limit", datatypes.UNSIGNED32, "rw"),
        ("Number of pole pairs", datatypes.UNSIGNED8, "rw"),
        ("Thermal time constant winding", datatypes.UNSIGNED16, "rw"),
        ("Torque constant", datatypes.UNSIGNED32, "rw"),
    ),
    0x30D2: (("Torque actual value averaged", datatypes.INTEGER16, "ro"),),
}
"""Index to the members from sub-index 1 on; sub-index 0 is their number."""
_OF_A_PDO = (
    ("COB-ID", datatypes.UNSIGNED32, "rw"),
    ("Transmission type", datatypes.UNSIGNED8, "rw"),
)
_MAPPED = tuple((f"Mapped object {k}", datatypes.UNSIGNED32, "rw") for k in range(1, 13))
for _number in range(4):
    RECORDS[0x1400 + _number] = _OF_A_PDO
    RECORDS[0x1800 + _number] = (*_OF_A_PDO, ("Inhibit time", datatypes.UNSIGNED16, "rw"))
    RECORDS[0x1600 + _number] = RECORDS[0x1A00 + _number] = _MAPPED


def object_dictionary() -> ObjectDictionary:
    """Return the dictionary of a drive."""
    made = ObjectDictionary()  # type: ignore[no-untyped-call]
    for index, name, kind, access in OBJECTS:
        made.add_object(_variable(index, 0, name, kind, access))
    for index, members in RECORDS.items():
        record = ODRecord(f"{index:#06x}", index)
        count = ("Number of entries", datatypes.UNSIGNED8, "rw" if members is _MAPPED else "ro")
        for subindex, member in enumerate((count, *members)):
            record.add_member(_variable(index, subindex, *member))
        made.add_object(record)
    return made


def _variable(index: int, subindex: int, name: str, kind: int, access: str) -> ODVariable:
    variable = ODVariable(name, index, subindex)
    variable.data_type, variable.access_type = kind, access
    return variable
