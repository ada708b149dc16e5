"""Emulated STM32F103 as needed by the firmware of the Blue Pill, with a USB host.

The Cortex-M3 is unicorn's. Its registers are modelled after RM0008 (STMicroelectronics): clocks (7.3), converters
(11.12), the tick (PM0056, 4.5), and the USB device (23.4, 23.5), whose flags are cleared by 0, its states toggled by 1.
"""

from __future__ import annotations

import struct
from collections.abc import Callable, Iterator
from typing import Any

from unicorn import UC_ARCH_ARM, UC_MODE_MCLASS, UC_MODE_THUMB, Uc
from unicorn.arm_const import UC_ARM_REG_LR, UC_ARM_REG_PC, UC_ARM_REG_SP

FLASH, RAM, SYSTEM = 0x08000000, 0x20000000, 0x1FFFF000
UNIQUE_ID = SYSTEM + 0x7E8
RETURN = FLASH + 0xF000
PERIPHERALS, PRIVATE = 0x40000000, 0xE000E000
RCC_CR, RCC_CFGR = 0x40021000, 0x40021004
ADC_CR2S, ADC1_DR, ADC_IRQ = (0x40012408, 0x40012808), 0x4001244C, 18
TIMER3_CR1, TIMER3_ARR, NVIC_ENABLE, SYSTICK_VALUE = 0x40000400, 0x4000042C, 0xE000E100, 0xE000E018
PORT_B_IN, PORT_B_OUT = 0x40010C08, 0x40010C0C
ENDPOINTS, ISTR, DADDR, MEMORY = 0x40005C00, 0x40005C44, 0x40005C4C, 0x40006000
RECEIVED, WAS_SETUP, WAS_SENT, BUS_RESET = 0x8000, 0x0800, 0x0080, 0x0400
STALLED, NOT_YET, READY = 1, 2, 3


class BluePill:
    """The chip, running an image; `run` lets it go on for some instructions."""

    def __init__(self, image: bytes) -> None:
        self.registers: dict[int, int] = {}
        self.endpoints, self.memory = [0] * 8, [0] * 256
        self.interrupts, self.ticks, self.converted = 0, 0, 0
        self._core: Any = Uc(UC_ARCH_ARM, UC_MODE_THUMB | UC_MODE_MCLASS)
        self._core.mem_map(FLASH, 0x10000)
        self._core.mem_write(FLASH, image)
        self._core.mem_map(RAM, 0x5000)
        self._core.mem_map(SYSTEM, 0x1000)
        self._core.mem_write(UNIQUE_ID, bytes(range(12)))
        for base, size in ((PERIPHERALS, 0x30000), (PRIVATE, 0x1000)):
            self._core.mmio_map(base, size, self._reader(base), None, self._writer(base), None)
        stack, self._at = struct.unpack_from("<2I", image)
        (self._scan_ready,) = struct.unpack_from("<I", image, 4 * (16 + ADC_IRQ))
        self._core.reg_write(UC_ARM_REG_SP, stack)

    def run(self, instructions: int) -> None:
        """Go on for so many."""
        self._core.emu_start(self._at | 1, 0xFFFFFFFF, count=instructions)
        self._at = self._core.reg_read(UC_ARM_REG_PC)

    @property
    def is_sampling(self) -> bool:
        """True if the timer triggers conversions whose end causes an interrupt."""
        return bool(self.registers.get(TIMER3_CR1, 0) & 1 and self.registers.get(NVIC_ENABLE, 0) >> ADC_IRQ & 1)

    def convert(self, first: int, second: int, is_missed: bool = False) -> None:
        """Convert both inputs (12 bits each) one timer period later. `is_missed`: the interrupt comes too late."""
        self.ticks += self.registers[TIMER3_ARR] + 1
        if not is_missed:
            self.converted = first | second << 16
            saved = self._core.context_save()
            self._core.reg_write(UC_ARM_REG_LR, RETURN | 1)
            self._core.emu_start(self._scan_ready | 1, RETURN, count=5000)
            self._core.context_restore(saved)

    def _reader(self, base: int) -> Callable[..., int]:
        return lambda _core, offset, _size, _data: self._read(base + offset)

    def _writer(self, base: int) -> Callable[..., None]:
        return lambda _core, offset, _size, value, _data: self._write(base + offset, value)

    def _read(self, address: int) -> int:
        value = self.registers.get(address, 0)
        if ENDPOINTS <= address < ENDPOINTS + 32:
            return self.endpoints[(address - ENDPOINTS) // 4]
        if MEMORY <= address < MEMORY + 1024:
            return self.memory[(address - MEMORY) // 4]
        special: dict[int, int] = {
            RCC_CR: value | (value & (1 << 16 | 1 << 24)) << 1,  # what is switched on is ready
            RCC_CFGR: value | (value & 3) << 2,  # the clock that was asked for runs
            ADC1_DR: self.converted,
            SYSTICK_VALUE: -self.ticks & 0xFFFFFF,
            PORT_B_IN: self.registers.get(PORT_B_OUT, 0),
            ISTR: self._state(),
        } | dict.fromkeys(ADC_CR2S, value & ~0xC)  # calibrations are done
        return special.get(address, value)

    def _write(self, address: int, value: int) -> None:
        if ENDPOINTS <= address < ENDPOINTS + 32:
            place = (address - ENDPOINTS) // 4
            old = self.endpoints[place]
            kept = value & 0x070F | old & WAS_SETUP | old & value & (RECEIVED | WAS_SENT)
            self.endpoints[place] = kept | (old ^ value) & 0x7070
        elif MEMORY <= address < MEMORY + 1024:
            self.memory[(address - MEMORY) // 4] = value & 0xFFFF
        elif address == ISTR:
            self.interrupts &= value
        else:
            self.registers[address] = value

    def _state(self) -> int:
        done = next((n for n, value in enumerate(self.endpoints) if value & (RECEIVED | WAS_SENT)), None)
        return self.interrupts | (0 if done is None else 0x8000 | done)


class UsbHost:
    """A USB host with this device only."""

    def __init__(self, chip: BluePill) -> None:
        self.chip = chip
        chip.run(1_500_000)
        chip.interrupts |= BUS_RESET
        chip.run(20_000)

    def enumerate(self) -> dict[str, bytes]:
        """Its descriptors; an address is given and the configuration set as a host does."""
        read = {"device": self.ask("8006 0001 0000 4000"), "refused": self.ask("8006 0006 0000 0a00")}
        self.ask("0005 0700 0000 0000")
        read["configuration"] = self.ask("8006 0002 0000 ff00")
        read["serial"] = self.ask("8006 0303 0904 ff00")
        self.ask("0009 0100 0000 0000")
        return read

    def ask(self, request: str) -> bytes:
        """Send a control request of eight bytes (hexadecimal) and return the answer; b"stall" if it is rejected."""
        packet = bytes.fromhex(request)
        self._put(0, packet)
        self._receive(0, RECEIVED | WAS_SETUP | 0x4040, NOT_YET << 12 | NOT_YET << 4)
        self.chip.endpoints[0] &= ~WAS_SETUP
        answer = b""
        while (part := self.take(0)) is not None:
            if self.chip.endpoints[0] >> 4 & 3 == STALLED:
                return b"stall"
            answer += part
            if len(part) < 64:
                break
        if packet[0] & 0x80:
            self.give(0, b"")
        return answer

    def give(self, endpoint: int, data: bytes) -> None:
        """Packets to an endpoint."""
        for start in range(0, max(len(data), 1), 64):
            self._wait(endpoint, 12)
            self._put(endpoint, data[start : start + 64])
            self._receive(endpoint, RECEIVED, NOT_YET << 12)
            self.chip.endpoints[endpoint] ^= 0x4000

    def take(self, endpoint: int) -> bytes | None:
        """Return the packet that an endpoint has ready; None without one, b"" if it is stalled."""
        if not self._wait(endpoint, 4):
            return b"" if self.chip.endpoints[endpoint] >> 4 & 3 == STALLED else None
        place, size = self.chip.memory[4 * endpoint] // 2, self.chip.memory[4 * endpoint + 1] & 0x3FF
        words = self.chip.memory[place : place + (size + 1) // 2]
        self.chip.endpoints[endpoint] = self.chip.endpoints[endpoint] & ~0x30 | NOT_YET << 4 | WAS_SENT
        self.chip.endpoints[endpoint] ^= 0x40
        self.chip.run(2000)
        return struct.pack(f"<{len(words)}H", *words)[:size]

    def packets(self) -> Iterator[bytes]:
        """Return all packets that the serial port has now."""
        while (part := self.take(1)) is not None:
            yield part

    def _wait(self, endpoint: int, shift: int) -> bool:
        for _ in range(20):
            if self.chip.endpoints[endpoint] >> shift & 3 == READY:
                return True
            self.chip.run(2000)
        return False

    def _put(self, endpoint: int, data: bytes) -> None:
        place = self.chip.memory[4 * endpoint + 2] // 2
        padded = data + bytes(len(data) % 2)
        self.chip.memory[place : place + len(padded) // 2] = struct.unpack(f"<{len(padded) // 2}H", padded)
        self.chip.memory[4 * endpoint + 3] = self.chip.memory[4 * endpoint + 3] & 0xFC00 | len(data)

    def _receive(self, endpoint: int, flags: int, states: int) -> None:
        """Receive a packet as the chip does; a SETUP makes both directions wait."""
        open_states = 0x3030 if flags & WAS_SETUP else 0x3000
        self.chip.endpoints[endpoint] = self.chip.endpoints[endpoint] & ~open_states | flags | states
        self.chip.run(3000)
