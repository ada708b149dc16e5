"""The device of a live test: opened, its rate checked, waited for when it is away."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterator

from acquisition import Block, Channel, Device, DeviceError, Event, EventKind, Remark
from acquisition.channel import ChannelQuantity
from lobewatch.machine.folder import MachineFolder
from lobewatch.machine.known_devices import checked_rate, has_clock, known_rate
from lobewatch.tap.in_progress import TapInProgress
from lobewatch.tap.live_signal import LiveSignal, description
from lobewatch.tap.publisher import Publisher
from lobewatch.tap.state import Check, TapStep

RETRY_TIME = 0.5
"""Time between two tries to find the device again (s)."""
BOUNCE_TIME = 0.3
"""Time after a move of the button in which a press is its bouncing (s)."""


class Button:
    """The button of a device, which takes the last good hit back.

    Presses are told from bouncing by the clock of the device: events that wait to be read come all at once.
    """

    def __init__(self, sample_rate: float) -> None:
        """Not pressed yet; sample_rate: of the scans that events are timed by (Hz)."""
        self._bounce = BOUNCE_TIME * sample_rate
        self._moved: int | None = None

    def presses(self, events: deque[Event]) -> int:
        """Take all events that wait, and count the presses in them."""
        count = 0
        while events:
            event = events.popleft()
            if event.kind == EventKind.BUTTON:
                count += event.begins and (self._moved is None or abs(event.scan - self._moved) >= self._bounce)
                self._moved = event.scan
        return count


class Connection:
    """One opened device: its scans, and what it tells beside them."""

    def __init__(self, device: Device, quantity: ChannelQuantity = "force", direction: str = "") -> None:
        """quantity: by which hits are seen; direction: the one that is tapped; DataError as `input_channels`."""
        self._device = device
        self.direction = direction
        """Direction that is tapped, by which one of several accelerations is chosen."""
        self.signal = LiveSignal(device, quantity, direction)
        """Its newest samples."""
        self._button = Button(device.sample_rate)
        self._fault = ""

    @property
    def channels(self) -> tuple[Channel, ...]:
        """All channels of the device."""
        return self._device.channels

    @property
    def sample_rate(self) -> float:
        """Sample rate (Hz)."""
        return self._device.sample_rate

    def start(self) -> None:
        """Begin the stream; what the button did before counts for nothing."""
        self._device.start()
        self._device.events.clear()

    def blocks(self) -> Iterator[Block]:
        """Blocks that the device sends from now on."""
        for block in self._device.blocks():
            self.signal.add(block)
            yield block

    def presses(self) -> int:
        """Number of presses of its button since this was last asked for."""
        return self._button.presses(self._device.events)

    def news(self) -> str:
        """Sentence on a pulled sensor cable or a missing supply, or that it is mended, where the device tells; once."""
        before, self._fault = self._fault, self._device.fault
        if self._fault == before:
            return ""
        return self._fault or "The sensor is connected again."

    def close(self) -> None:
        """Stop, and give the port back."""
        self._device.close()


class Connector:
    """Opens the device of a test, again and again where it must."""

    def __init__(
        self,
        folder: MachineFolder,
        open_device: Callable[[], Device],
        publisher: Publisher,
        sleep: Callable[[float], None],
    ) -> None:
        """Nothing is opened yet."""
        self._folder, self._open_device, self._publisher, self._sleep = folder, open_device, publisher, sleep

    def connect(self, tap: TapInProgress) -> Connection:
        """A started device that the hits of a test may come from.

        Raises DeviceError where there is none, ValueError where it has another set-up than the test was begun with.
        """
        device = self._open_device()
        try:
            self._check_rate(device)
            connection = Connection(device, self._folder.machine.tap.quantity, tap.circumstances.direction)
            tap.accept_device(device.sample_rate, connection.signal.inputs.channels, description(device))
            connection.start()
        except BaseException:
            device.close()
            raise
        self._publisher.show(device=f"{device.identity.model}, {device.sample_rate:g} Hz")
        return connection

    def reconnect(self, error: DeviceError, tap: TapInProgress, serve: Callable[[], None]) -> Connection:
        """Wait for the device, as long as it takes; `serve` is called meanwhile."""
        while True:
            reason = f"{error.text}; plug it in: the test goes on at this hit"
            self._publisher.show(word=TapStep.NO_DEVICE, reason=reason, levels=None)
            self._sleep(RETRY_TIME)
            serve()
            try:
                connection = self.connect(tap)
            except DeviceError as again:
                error = again
            else:
                self._publisher.show(word=TapStep.WAIT, reason="")
                return connection

    def _check_rate(self, device: Device) -> None:
        """Against the clock, of a device that this machine does not know yet."""
        if has_clock(device) and known_rate(self._folder, device) is None:
            self._publisher.show(reason="New device: its sample rate is measured against the clock for 5 s.")
        remarks = list[Remark]()
        checked_rate(self._folder, device, remarks=remarks)
        if remarks:
            self._publisher.show(checks=tuple(Check("sample rate", False, f"{remark}") for remark in remarks))
