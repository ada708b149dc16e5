"""Which inputs of a device a tap test reads, and the hit that their codes make."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from acquisition.channel import Channel, ChannelQuantity
from acquisition.errors import DataError
from acquisition.hit import Hit


@dataclass(frozen=True)
class TapInputs:
    """Inputs of a device that a tap test reads: the force first, the response of the driving point last."""

    rows: tuple[int, ...]
    """Index of each among the channels of the device."""
    channels: tuple[Channel, ...]
    """Sensor on each."""

    @classmethod
    def of(cls, channels: tuple[Channel, ...], quantity: ChannelQuantity = "force", direction: str = "") -> Self:
        """Those of a tap in a direction, as `input_channels` has it; DataError where they are not there.

        A hammer in x is felt by a second sensor along y too, where there is one: it stands before the last.
        """
        first, *last = input_channels(channels, quantity, direction)
        along_y = (i for i, channel in enumerate(channels) if (channel.quantity, channel.direction) == _ALONG_Y)
        across = [i for i in along_y if direction == "x" and last and i not in last]
        rows = (first, *across[:1], *last)
        return cls(rows, tuple(channels[row] for row in rows))

    def hit(
        self,
        codes: NDArray[np.integer[Any]],
        sample_rate: float,
        pre_trigger: int = 0,
        lost_scans: int = 0,
        overload: int = 0,
    ) -> Hit:
        """The hit that codes are, a row each; bit i of overload is that of row i."""

        def felt_by(response: int, beside: Hit | None = None) -> Hit:
            rows = [0, response] if len(self.rows) > 1 else [response]
            mask = (overload >> response & 1) << 1 | (overload & 1 if len(rows) > 1 else 0)
            sensors = tuple(self.channels[row] for row in rows)
            return Hit.from_codes(codes[rows], sensors, sample_rate, pre_trigger, lost_scans, mask, beside)

        last = len(self.rows) - 1
        return felt_by(last, felt_by(1) if last > 1 else None)


_ALONG_Y = ("acceleration", "y")


def input_channels(
    channels: tuple[Channel, ...], quantity: ChannelQuantity = "force", direction: str = ""
) -> tuple[int, ...]:
    """Index of the force and of the acceleration channel; of the latter alone where that triggers.

    direction: the one that is tapped; of several accelerations, as of a sensor with three axes, that of this direction
    (of a tap across, "xy", that of y). DataError unless there is one of each that is needed.
    """
    forces = [i for i, channel in enumerate(channels) if channel.quantity == "force"]
    responses = [i for i, channel in enumerate(channels) if channel.quantity == "acceleration"]
    several, seen = len(responses) > 1, direction[-1:] or "x"
    if several:
        responses = [i for i in responses if direction and channels[i].direction == seen]
    if len(responses) == 1 and (quantity == "acceleration" or len(forces) == 1):
        return (*forces, *responses) if quantity == "force" else (*responses,)
    listed = ", ".join(channel.name for channel in channels) or "nothing"
    needed = "one force and one acceleration channel are needed"
    if quantity == "acceleration":
        needed = "one acceleration channel is needed to tap without a force sensor"
    which = f', of several that with direction = "{seen}"' if several else ""
    raise DataError(f"the DAQ has channels for {listed}; {needed}{which}")
