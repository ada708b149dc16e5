"""Emulated vendor libraries, with the names, shapes and errors of their documentation.

sounddevice 0.5.6, nidaqmx 1.7.0, daqhats 1.4.1.0, uldaq 1.2.3, labjack-ljm 1.23.0. Each reads a `Wiring`.
"""

from __future__ import annotations

import ctypes
import threading
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from types import ModuleType, SimpleNamespace
from typing import Any

import numpy as np
from numpy.typing import NDArray

Volts = NDArray[np.float64]


@dataclass
class Wiring:
    """Signals at the inputs, and faults."""

    volts_at: Callable[[float], Callable[[int, int], Volts]]
    """Voltages (V), for a rate (Hz): (first scan, number of scans) -> (2, n)."""
    inputs: tuple[int, ...] = (0, 1)
    """The inputs that the rows of the voltages are on."""
    faults: set[str] = field(default_factory=set)
    """Faults that begin at the next read: "overrun", "unplugged", "silent"."""
    log: list[Any] = field(default_factory=list)
    """Settings in order."""

    def stream(self, rate: float, n_inputs: int) -> Callable[[int], Volts]:
        """Return the function that reads next scans: number -> (n_inputs, n), open inputs at 0 V."""
        volts, position = self.volts_at(rate), 0

        def read(n_scans: int) -> Volts:
            nonlocal position
            rows = np.zeros((n_inputs, n_scans))
            rows[list(self.inputs)] = volts(position, n_scans)
            position += n_scans
            return rows

        return read


def module(name: str, **members: Any) -> ModuleType:
    made = ModuleType(name)
    made.__dict__.update(members)
    return made


def fake_sounddevice(
    wiring: Wiring, names: Sequence[str], full_scale: float, actual_rate: float | None = None
) -> ModuleType:
    """Make devices with these names and two inputs, except HDMI (none) and Mono (one). Rates are 44.1 and 48 kHz."""

    class PortAudioError(Exception):
        def __str__(self) -> str:
            return f"{self.args[0]} [PaErrorCode {self.args[1]}]"

    devices: list[dict[str, Any]] = [
        {"name": name, "index": k, "max_input_channels": {"HDMI": 0, "Mono": 1}.get(name[:4], 2)}
        for k, name in enumerate(names)
    ]

    def check_input_settings(
        device: int, channels: int, dtype: str, extra_settings: None = None, samplerate: float | None = None
    ) -> None:
        if channels > devices[device]["max_input_channels"]:
            raise PortAudioError("Invalid number of channels", -9998)
        if samplerate not in (44100.0, 48000.0):
            raise PortAudioError("Invalid sample rate", -9997)
        if "no 32 bits" in wiring.faults:
            raise PortAudioError("Sample format not supported", -9994)
        assert dtype == "int32"

    class InputStream:
        def __init__(
            self, samplerate: float, blocksize: int, device: int, channels: int, dtype: str, *, callback: Any
        ) -> None:
            assert dtype == "int32"
            if "busy" in wiring.faults:
                raise PortAudioError("Error opening InputStream: Device unavailable", -9985)
            self.samplerate = actual_rate or samplerate
            self._read = wiring.stream(samplerate, channels)
            self._size, self._callback, self._running = blocksize, callback, False

        def start(self) -> None:
            self._running = True
            self._thread = threading.Thread(target=self._run, daemon=True)
            self._thread.start()

        def _run(self) -> None:
            while self._running:
                if "silent" not in wiring.faults:
                    overflow = "overrun" in wiring.faults
                    wiring.faults.discard("overrun")
                    codes = np.clip(np.rint(self._read(self._size) / full_scale * 2**23), -(2**23), 2**23 - 1)
                    data = np.ascontiguousarray(codes.T.astype(np.int32) << 8)
                    self._callback(data, self._size, None, SimpleNamespace(input_overflow=overflow))
                time.sleep(self._size / self.samplerate / 20)

        def stop(self) -> None:
            if self._running:
                self._running = False
                self._thread.join()

        def close(self) -> None:
            self.stop()

    return module(
        "sounddevice",
        PortAudioError=PortAudioError,
        query_devices=lambda: devices,
        check_input_settings=check_input_settings,
        InputStream=InputStream,
    )


def fake_nidaqmx(wiring: Wiring, rates: Sequence[float]) -> dict[str, ModuleType]:
    """Make a cDAQ with one NI 9234, "cDAQ1Mod1": 4 inputs, +-5 V, 2 mA. A rate is rounded up to one of `rates` (Hz)."""

    class Error(Exception):
        pass

    class DaqError(Error):
        def __init__(self, message: str, error_code: int) -> None:
            super().__init__(f"{message}\n\nStatus Code: {error_code}")
            self.error_code = error_code

    class Device:
        def __init__(self, name: str) -> None:
            self.name = name

        def __getattribute__(self, key: str) -> Any:
            if key != "name" and not key.startswith("__") and self.name != "cDAQ1Mod1":
                raise DaqError("Device identifier is invalid.", -200220)
            return super().__getattribute__(key)

        product_type = "NI 9234"
        serial_num = 0x1A2B3C
        ai_physical_chans = ("ai0", "ai1", "ai2", "ai3")
        ai_max_multi_chan_rate = 51200.0
        ai_current_int_excit_discrete_vals = (0.0, 0.002)

    class Task:
        def __init__(self) -> None:
            if "busy" in wiring.faults:
                raise DaqError("The specified resource is reserved.", -50103)
            self.names: list[str] = []
            self.ai_channels = SimpleNamespace(add_ai_voltage_chan=self._add)
            self.timing = SimpleNamespace(cfg_samp_clk_timing=self._time, samp_clk_rate=0.0)
            self.in_stream = SimpleNamespace(task=self, open_current_loop_chans_exist=False, open_current_loop_chans=[])

        def _add(self, physical: str, *, min_val: float, max_val: float) -> SimpleNamespace:
            self.names.append(physical)
            wiring.log.append(entry := SimpleNamespace(name=physical, ai_rng_high=5.0))
            return entry

        def _time(self, rate: float, *, sample_mode: str, samps_per_chan: int) -> None:
            assert sample_mode == "CONTINUOUS"
            self.timing.samp_clk_rate = min(entry for entry in rates if entry >= rate)

        def start(self) -> None:
            self.read = wiring.stream(self.timing.samp_clk_rate, 4)

        def stop(self) -> None:
            wiring.log.append("stop")

        def close(self) -> None:
            wiring.log.append("close")

    class AnalogMultiChannelReader:
        def __init__(self, in_stream: Any) -> None:
            self._stream = in_stream

        def read_many_sample(self, data: Volts, number_of_samples_per_channel: int, timeout: float) -> int:
            task = self._stream.task
            if "silent" in wiring.faults:
                time.sleep(timeout)
                raise DaqError("Some or all of the samples requested have not yet been acquired.", -200284)
            if "overrun" in wiring.faults:
                raise DaqError("Attempted to read samples that are no longer available.", -200279)
            if "unplugged" in wiring.faults:
                raise DaqError("Device is not available.", -200045)
            if "open loop" in wiring.faults:
                self._stream.open_current_loop_chans_exist, self._stream.open_current_loop_chans = True, task.names[1:]
            rows = [int(name.rpartition("ai")[2]) for name in task.names]
            data[:] = task.read(number_of_samples_per_channel)[rows]
            return number_of_samples_per_channel

    system = SimpleNamespace(local=lambda: SimpleNamespace(devices=[Device("cDAQ1Mod1")]))
    constants = module(
        "nidaqmx.constants",
        Coupling=SimpleNamespace(AC="AC"),
        ExcitationSource=SimpleNamespace(INTERNAL="INTERNAL"),
        AcquisitionType=SimpleNamespace(CONTINUOUS="CONTINUOUS"),
    )
    return {
        "nidaqmx": module("nidaqmx", Task=Task),
        "nidaqmx.system": module("nidaqmx.system", System=system, Device=Device),
        "nidaqmx.constants": constants,
        "nidaqmx.errors": module("nidaqmx.errors", Error=Error, DaqError=DaqError),
        "nidaqmx.stream_readers": module("nidaqmx.stream_readers", AnalogMultiChannelReader=AnalogMultiChannelReader),
    }


def fake_daqhats(wiring: Wiring) -> ModuleType:
    """Make a Raspberry Pi with one MCC 172 at address 0. Rates are 51.2 kHz / n."""

    class HatError(Exception):
        def __init__(self, address: int, value: str) -> None:
            super().__init__(f"Addr {address}: {value}")

    class Board:
        def __init__(self, address: int) -> None:
            if address != 0:
                raise HatError(address, "Board not responding.")
            self._asked, self._active = 0, False

        def serial(self) -> str:
            return "01A2B3C4"

        def firmware_version(self) -> SimpleNamespace:
            return SimpleNamespace(version="1.01")

        def iepe_config_write(self, channel: int, mode: int) -> None:
            wiring.log.append((channel, mode))

        def a_in_clock_config_write(self, source: str, rate: float) -> None:
            assert source == "LOCAL"
            self._rate = 51200.0 / max(1, round(51200.0 / rate))

        def a_in_clock_config_read(self) -> SimpleNamespace:
            self._asked += 1
            return SimpleNamespace(
                synchronized=self._asked > 2 and "no sync" not in wiring.faults, sample_rate_per_channel=self._rate
            )

        def a_in_scan_start(self, mask: int, samples: int, options: int) -> None:
            if self._active or "busy" in wiring.faults:
                raise HatError(0, "A scan is already active.")
            assert (mask, samples, options) == (3, 0, 16)
            self._active, self._read = True, wiring.stream(self._rate, 2)

        def a_in_scan_read_numpy(self, samples: int, timeout: float) -> SimpleNamespace:
            if not self._active:
                raise HatError(0, "Scan not active.")
            if "unplugged" in wiring.faults:
                raise HatError(0, "Incorrect response -2.")
            lost, silent = "overrun" in wiring.faults, "silent" in wiring.faults
            if silent:
                time.sleep(timeout)
            data = np.zeros(0) if lost or silent else self._read(samples).T.ravel()
            return SimpleNamespace(
                running=not lost, hardware_overrun=False, buffer_overrun=lost, triggered=True, timeout=silent, data=data
            )

        def a_in_scan_stop(self) -> None:
            pass

        def a_in_scan_cleanup(self) -> None:
            self._active = False

    return module(
        "daqhats",
        HatError=HatError,
        HatIDs=SimpleNamespace(MCC_172=0x0145),
        OptionFlags=SimpleNamespace(CONTINUOUS=16),
        SourceType=SimpleNamespace(LOCAL="LOCAL"),
        hat_list=lambda filter_by_id: [
            SimpleNamespace(address=0, id=filter_by_id, version=1, product_name="MCC 172 HAT")
        ],
        mcc172=Board,
    )


def fake_uldaq(wiring: Wiring) -> ModuleType:
    """Make a USB-1608FS-Plus: 8 inputs, 16 bits, ranges 10, 5, 2 and 1 V. Each status query fills its ring."""

    class ULException(Exception):  # noqa: N818  (its name)
        pass

    descriptor = SimpleNamespace(product_name="USB-1608FS-Plus", unique_id="01F2A3B4")
    ranges = [SimpleNamespace(name=f"BIP{volts}VOLTS") for volts in (10, 5, 2, 1)]

    class Ai:
        def get_info(self) -> SimpleNamespace:
            return SimpleNamespace(
                get_num_chans_by_mode=lambda _mode: 8, get_ranges=lambda _mode: ranges, get_resolution=lambda: 16
            )

        def a_in_scan(
            self,
            low_channel: int,
            high_channel: int,
            input_mode: str,
            analog_range: str,
            samples_per_channel: int,
            rate: float,
            options: str,
            flags: str,
            data: Any,
        ) -> float:
            wiring.log.append((low_channel, high_channel, analog_range))
            assert (input_mode, options, flags) == ("SINGLE_ENDED", "CONTINUOUS", "DEFAULT")
            assert len(data) == (high_channel - low_channel + 1) * samples_per_channel
            self._low, self._high, self._ring, self._count = low_channel, high_channel, data, 0
            self._read = wiring.stream(rate, 8)
            return rate

        def get_scan_status(self) -> tuple[str, SimpleNamespace]:
            if "unplugged" in wiring.faults:
                raise ULException("UL Error: 9: Device may have been disconnected")
            ring = np.frombuffer(self._ring).reshape(-1, self._high - self._low + 1)
            step = 0 if "silent" in wiring.faults else len(ring) + 100 if "overrun" in wiring.faults else 1000
            wiring.faults.discard("overrun")
            rows = self._read(step).T[:, self._low : self._high + 1]
            ring[np.arange(self._count, self._count + step) % len(ring)] = rows
            self._count += step
            return "RUNNING", SimpleNamespace(current_scan_count=self._count)

        def scan_stop(self) -> None:
            pass

    class DaqDevice:
        def __init__(self, entry: SimpleNamespace) -> None:
            self._entry = entry

        def connect(self) -> None:
            if "busy" in wiring.faults:
                raise ULException("UL Error: 7: Device in use")

        def get_descriptor(self) -> SimpleNamespace:
            return self._entry

        def get_ai_device(self) -> Ai:
            return Ai()

        def disconnect(self) -> None:
            wiring.log.append("disconnect")

        def release(self) -> None:
            wiring.log.append("release")

    return module(
        "uldaq",
        ULException=ULException,
        InterfaceType=SimpleNamespace(USB=1),
        AiInputMode=SimpleNamespace(SINGLE_ENDED="SINGLE_ENDED"),
        Range=SimpleNamespace(**{entry.name: entry.name for entry in ranges}),
        ScanOption=SimpleNamespace(CONTINUOUS="CONTINUOUS"),
        AInScanFlag=SimpleNamespace(DEFAULT="DEFAULT"),
        get_daq_device_inventory=lambda _kind: [descriptor],
        create_float_buffer=lambda channels, samples: (ctypes.c_double * (channels * samples))(),
        DaqDevice=DaqDevice,
    )


def fake_ljm(wiring: Wiring) -> dict[str, ModuleType]:
    """Make a LabJack T7 with the serial number 470012345. Its rates are 80 MHz / n."""

    class LJMError(Exception):
        pass

    state: dict[str, Any] = {"opened": 0}

    def open_s(_kind: str, _connection: str, identifier: str) -> int:
        if identifier != "470012345":
            raise LJMError("LJM library error code 1227 LJME_DEVICE_NOT_FOUND")
        if "busy" in wiring.faults:
            raise LJMError("LJM library error code 1230 LJME_DEVICE_CURRENTLY_CLAIMED_BY_ANOTHER_PROCESS")
        state["opened"] += 1
        return int(state["opened"])

    def start(_handle: int, scans: int, count: int, inputs: list[int], rate: float) -> float:
        if "read" in state:
            raise LJMError("LJM library error code 2605 STREAM_IS_ACTIVE")
        actual = 80e6 / round(80e6 / rate)
        state.update(read=wiring.stream(actual, 14), size=scans, rows=[address // 2 for address in inputs], left=0)
        assert count == len(inputs)
        return actual

    def read(_handle: int) -> tuple[list[float], int, int]:
        if "unplugged" in wiring.faults:
            raise LJMError("LJM library error code 1301 LJME_NO_RESPONSE_BYTES_RECEIVED")
        values = state["read"](state["size"]).T[:, state["rows"]]
        if "overrun" in wiring.faults:
            wiring.faults.discard("overrun")
            values[500:700] = -9999.0
        return values.ravel().tolist(), 0, 0

    ljm = module(
        "labjack.ljm",
        LJMError=LJMError,
        constants=SimpleNamespace(dtANY=0, ctANY=0, dtT7=7, dtT8=8),
        listAll=lambda _kind, _connection: (1, [7], [1], [470012345], [0]),
        openS=open_s,
        eWriteName=lambda _handle, name, value: wiring.log.append((name, value)),
        eReadName=lambda _handle, _name: 1.0292,
        namesToAddresses=lambda count, names: ([2 * int(name[3:]) for name in names], [3] * count),
        getHandleInfo=lambda _handle: (7, 1, 470012345, 0, 0, 64),
        eStreamStart=start,
        eStreamRead=read,
        eStreamStop=lambda _handle: state.pop("read", None),
        close=lambda _handle: wiring.log.append("close"),
    )
    return {"labjack": module("labjack", ljm=ljm), "labjack.ljm": ljm}
