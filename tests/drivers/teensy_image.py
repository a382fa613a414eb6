"""A linked Teensy image run instruction by instruction, with every register write kept.

Not a board: peripherals do nothing, so what waits for one is answered here (USB, ADC, clock). It
says what the image does to which register and in which order, not how long it takes.
"""

import struct
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import unicorn
from elftools.elf.elffile import ELFFile
from unicorn import arm_const

RETURN = 0x7F000
BIT_BAND = 0x42000000
"""From here on a Cortex-M4 has a word for every bit of its peripherals."""
IRQ_OFF, IRQ_ON = 0xB672, 0xB662
"""The instructions `cpsid i` and `cpsie i`."""


@dataclass(frozen=True)
class Chip:
    """What differs between the two processors.

    Attributes:
        model: Unicorn's number of the core.
        memory: Address and size of what is there besides the peripherals.
        stack: Top of the stack.
        peripherals: First address and end of what is logged.
    """

    model: int
    memory: tuple[tuple[int, int], ...]
    stack: int
    peripherals: tuple[int, int]


K64 = Chip(
    arm_const.UC_CPU_ARM_CORTEX_M4,
    ((0, 0x80000), (0x1FFF0000, 0x40000)),
    0x2002F000,
    (0x40000000, 0x44000000),
)
RT1062 = Chip(
    arm_const.UC_CPU_ARM_CORTEX_M7,
    ((0, 0x80000), (0x20000000, 0x80000), (0x20200000, 0x80000), (0x60000000, 0x800000)),
    0x2007F000,
    (0x40000000, 0x42200000),
)


class TeensyImage:
    """One image in its emulator.

    Attributes:
        writes: Address and value of every write to a peripheral, in order.
        longest_locked: Most instructions on end with interrupts off in the last `call`.
    """

    def __init__(self, path: Path, chip: Chip) -> None:
        self.writes: list[tuple[int, int]] = []
        self.received = bytearray()
        self.sent = bytearray()
        self.analog = 2048
        self.now_us = 0
        self.longest_locked = self._locked = 0
        self._off = False
        self._chip = chip
        self._cpu = unicorn.Uc(unicorn.UC_ARCH_ARM, unicorn.UC_MODE_THUMB | unicorn.UC_MODE_MCLASS)
        self._cpu.ctl_set_cpu_model(chip.model)
        first, end = chip.peripherals
        for address, size in (*chip.memory, (first, end - first), (0xE0000000, 0x100000)):
            self._cpu.mem_map(address, size)
        self.symbols: dict[str, int] = {}
        with path.open("rb") as file:
            elf = ELFFile(file)
            for symbol in elf.get_section_by_name(".symtab").iter_symbols():
                if symbol["st_info"]["type"] == "STT_FUNC" or symbol.name not in self.symbols:
                    self.symbols[symbol.name] = symbol["st_value"]
            for section in elf.iter_sections():
                if section["sh_flags"] & 2 and section["sh_type"] == "SHT_PROGBITS":
                    self._cpu.mem_write(section["sh_addr"], section.data())
        self._cpu.mem_write(RETURN, b"\xfe\xe7")
        self.write_word(0xE000ED88, 0xF << 20)  # floating-point unit on
        self._cpu.hook_add(unicorn.UC_HOOK_MEM_WRITE, self._note, begin=first, end=end - 1)
        self._answer_peripherals()

    def boot(self) -> None:
        """Run static constructors and `setup`."""
        start, end = self.symbols["__init_array_start"], self.symbols["__init_array_end"]
        for place in range(start, end, 4):
            self.call(self.word(place))
        self.call("setup")

    def tick(self) -> int:
        """Run the sampling interrupt once; return the instructions it took."""
        self.now_us += 1000
        return self.call(next(v for name, v in self.symbols.items() if "sampleEv" in name))

    def call(self, what: str | int, limit: int = 3_000_000) -> int:
        """Call a function until it returns; return the instructions it took."""
        address = self.symbols[what] if isinstance(what, str) else what
        self._cpu.reg_write(arm_const.UC_ARM_REG_SP, self._chip.stack)
        self._cpu.reg_write(arm_const.UC_ARM_REG_LR, RETURN | 1)
        self._off, self.longest_locked = False, 0
        counted = [0]

        def count(_cpu: Any, at: int, size: int, _data: Any) -> None:
            counted[0] += 1
            code = self.half_word(at) if size == 2 else 0
            if code == IRQ_OFF:
                self._off, self._locked = True, 0
            elif code == IRQ_ON:
                self._off = False
                self.longest_locked = max(self.longest_locked, self._locked)
            self._locked += self._off

        hook = self._cpu.hook_add(unicorn.UC_HOOK_CODE, count)
        try:
            self._cpu.emu_start(address | 1, RETURN, count=limit)
        finally:
            self._cpu.hook_del(hook)
        return counted[0]

    def word(self, address: int) -> int:
        return int(struct.unpack("<I", self._cpu.mem_read(address, 4))[0])

    def half_word(self, address: int) -> int:
        return int(struct.unpack("<H", self._cpu.mem_read(address, 2))[0])

    def write_word(self, address: int, value: int) -> None:
        self._cpu.mem_write(address, struct.pack("<I", value))

    def last(self, address: int) -> int:
        """Return what was written to a register last.

        Raises:
            LookupError: Nothing was.
        """
        return next(value for at, value in reversed(self.writes) if at == address)

    def _note(self, _cpu: Any, _access: int, at: int, size: int, value: int, _data: Any) -> None:
        value &= (1 << 8 * size) - 1
        if self._chip is K64 and at >= BIT_BAND:
            byte, bit = (at - BIT_BAND) // 32, (at - BIT_BAND) % 32 // 4
            at, value = 0x40000000 + byte // 4 * 4, (value & 1) << (bit + byte % 4 * 8)
        self.writes.append((at, value))

    def _return(self, value: int) -> None:
        self._cpu.reg_write(arm_const.UC_ARM_REG_R0, value & 0xFFFFFFFF)
        self._cpu.reg_write(arm_const.UC_ARM_REG_PC, self._cpu.reg_read(arm_const.UC_ARM_REG_LR))

    def _arguments(self) -> tuple[int, int]:
        registers = arm_const.UC_ARM_REG_R0, arm_const.UC_ARM_REG_R1
        first, second = (int(self._cpu.reg_read(register)) for register in registers)
        return first, second

    def _answer_peripherals(self) -> None:
        noise = [0]

        def analog_read() -> int:
            noise[0] += 1
            return self.analog + noise[0] % 3

        def usb_write() -> int:
            address, size = self._arguments()
            self.sent += self._cpu.mem_read(address, size)
            return size

        def usb_read() -> int:
            address, room = self._arguments()
            given = bytes(self.received[:room])
            del self.received[:room]
            self._cpu.mem_write(address, given)
            return len(given)

        def a_second_passes() -> int:
            at = self.symbols["systick_millis_count"]
            self.write_word(at, self.word(at) + 1000)
            return 0

        answers: dict[str, Callable[[], int]] = {
            "yield": a_second_passes,
            "usb_serial_available": lambda: len(self.received),
            "usb_serial_getchar": lambda: self.received.pop(0) if self.received else -1,
            "usb_serial_read": usb_read,
            "usb_serial_write_buffer_free": lambda: 64,
            "usb_serial_write": usb_write,
            "usb_serial_flush_output": lambda: 0,
            "micros": lambda: self.now_us,
            "eeprom_read_dword": lambda: 41,
            "eeprom_write_dword": lambda: 0,
            "delay": lambda: 0,
            "wait_for_cal": lambda: 0,
            "analogRead": analog_read,
        }
        for name, answer in answers.items():
            if name in self.symbols:
                at = self.symbols[name] & ~1
                self._cpu.hook_add(
                    unicorn.UC_HOOK_CODE,
                    lambda *_, answer=answer: self._return(answer()),
                    begin=at,
                    end=at,
                )
