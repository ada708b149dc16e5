"""Emulate a board that prints a counter and the values of its sensors."""

import time
from dataclasses import dataclass

import numpy as np

from acquisition.emulation import EmulatorThread, SignalFunction
from acquisition.text_boards.decoders import OutputFormat


@dataclass(frozen=True)
class TextBoardTraits:
    """Properties and faults of the board."""

    counter_bits: int = 16
    """Bits of the counter, 0 for no counter."""
    drop_every: int = 0
    """Period in scans at which one is lost, 0 for never."""
    garble_every: int = 0
    """Period in scans at which one is printed with a broken byte, 0 for never."""


SCANS_PER_PRINT = 64
"""Scans printed at once."""


class TextBoardEmulator(EmulatorThread):
    """Emulated board that prints from the moment it is plugged in. It reads nothing.

    Parameters
    ----------
    signal
        Function (first_scan, n_scans) that returns values in N and m/s^2, one row per sensor.
    sensitivities
        Sensitivity of each sensor (V per N or m/s^2).
    full_scale
        Full scale of all channels (V).
    sample_rate
        Sample rate (Hz).
    realtime
        Whether it prints by the clock. False prints as fast as the host reads.
    tcp
        Whether it listens on loopback instead of a pseudo-terminal.
    printing
        Output format, None for volts in lines.
    traits
        Properties and faults, None for the defaults.
    """

    def __init__(
        self,
        signal: SignalFunction,
        sensitivities: tuple[float, ...],
        full_scale: float,
        sample_rate: float,
        *,
        realtime: bool = True,
        tcp: bool = False,
        printing: OutputFormat | None = None,
        traits: TextBoardTraits | None = None,
    ) -> None:
        super().__init__(tcp)
        self._signal, self._rate, self._realtime = signal, sample_rate, realtime
        self._printing, self._traits = printing or OutputFormat(), traits or TextBoardTraits()
        self._sensitivities, self._full_scale = np.array(sensitivities)[:, None], full_scale
        self._scan, self._begun = 0, time.monotonic()

    def serve_once(self) -> bool:
        self.wire.exchange(0.002)
        while self._due():
            volts = self._signal(self._scan, SCANS_PER_PRINT) * self._sensitivities
            for k, row in enumerate(np.clip(volts, -self._full_scale, self._full_scale).T):
                self._print(self._scan + k, row)
            self._scan += SCANS_PER_PRINT
        return True

    def _due(self) -> bool:
        if not self._realtime:
            return len(self.wire.pending) < 1 << 15
        return self._scan + SCANS_PER_PRINT <= (time.monotonic() - self._begun) * self._rate

    def _print(self, number: int, volts: np.ndarray) -> None:
        how = self._traits
        if how.drop_every and number % how.drop_every == how.drop_every - 1:
            return
        text = bytearray(self._frame(number, volts) if self._printing.frame else self._line(number, volts))
        if how.garble_every and number % how.garble_every == how.garble_every - 1:
            text[len(text) // 2] ^= 0x55
        self.wire.pending += text

    def _counter(self, number: int) -> list[int]:
        return [number % 2**self._traits.counter_bits] if self._traits.counter_bits else []

    def _line(self, number: int, volts: np.ndarray) -> bytes:
        bits = self._printing.adc_bits
        if bits is None:
            words = [f"{volt:.7f}" for volt in volts]
        else:
            codes = np.rint(volts / self._full_scale * 2 ** (bits - 1)) + 2 ** (bits - 1)
            words = [str(int(code)) for code in np.clip(codes, 0, 2**bits - 1)]
        return ",".join([*map(str, self._counter(number)), *words]).encode() + b"\r\n"

    def _frame(self, number: int, volts: np.ndarray) -> bytes:
        form = self._printing.frame
        assert form is not None
        codes = np.clip(np.rint(volts / self._full_scale * 2**15), -(2**15), 2**15 - 1).astype("<i2").tobytes()
        payload = (number % 65536).to_bytes(2, "little") * form.counter + codes
        return form.start + payload + bytes([sum(payload) & 0xFF]) * form.checksum
