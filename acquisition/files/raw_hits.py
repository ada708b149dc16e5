"""Write and read hits in HDF5: settings, ADC codes or samples, and the faults of each."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import fields
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from acquisition.channel import Channel
from acquisition.hit import Hit
from acquisition.hit_fault import HitFlags

if TYPE_CHECKING:
    import h5py

HDF5_COMPRESSION = {"compression": "gzip", "compression_opts": 1, "shuffle": True, "fletcher32": True}
"""Options of compressed datasets."""


class HitSettings(NamedTuple):
    """Settings that all hits of a test share."""

    sample_rate: float
    """Sample rate (Hz)."""
    pre_trigger: int
    """Samples before the trigger."""
    channels: tuple[Channel, ...]
    """Channels of the codes; empty if the hits are samples."""

    @classmethod
    def from_hit(cls, hit: Hit) -> HitSettings:
        return cls(hit.sample_rate, hit.pre_trigger, (hit.channels or ()) if hit.codes is not None else ())


def write_dataset(group: h5py.Group, name: str, data: Any, units: str, **options: Any) -> None:
    """Write a dataset with its units."""
    group.create_dataset(name, data=data, **options).attrs["units"] = units


def write_channel(attributes: h5py.AttributeManager, channel: Channel) -> None:
    """Write the fields of a channel as attributes."""
    attributes.update({field.name: getattr(channel, field.name) for field in fields(Channel)})


def read_channel(attributes: h5py.AttributeManager) -> Channel:
    """Read the channel that `write_channel` wrote; raise KeyError if a field is missing."""
    values = convert_to_plain(attributes)
    return Channel(**{field.name: values[field.name] for field in fields(Channel)})


def convert_to_plain(attributes: h5py.AttributeManager) -> dict[str, Any]:
    """Return attributes as Python values."""
    return {name: value.item() if isinstance(value, np.generic) else value for name, value in attributes.items()}


def choose_code_type(channels: Sequence[Channel]) -> type[np.int16 | np.int32]:
    """Return the smallest integer type for the codes of these channels."""
    return np.int16 if max(channel.adc_bits for channel in channels) <= 16 else np.int32


def write_raw_hits(
    file: h5py.Group, hits: Sequence[Hit], flags: Sequence[HitFlags], decided: Sequence[HitFlags]
) -> None:
    """Write hits and the flags of each, before and after decisions, in their own group; nothing without hits."""
    if hits:
        raw = file.create_group("raw")
        write_hit_settings(raw, HitSettings.from_hit(hits[0]))
        write_hits(raw, hits, flags, decided)


def write_hit_settings(raw: h5py.Group, settings: HitSettings) -> None:
    """Write the settings of hits."""
    raw.attrs.update(sample_rate_hz=settings.sample_rate, pre_trigger_samples=settings.pre_trigger)
    for i, channel in enumerate(settings.channels):
        write_channel(raw.create_group(f"channel_{i}").attrs, channel)


def write_hits(raw: h5py.Group, hits: Sequence[Hit], flags: Sequence[HitFlags], decided: Sequence[HitFlags]) -> None:
    """Write hits of the same settings and the flags of each, before and after decisions."""
    first = hits[0]
    if first.codes is not None and first.channels is not None:
        codes = np.stack([hit.codes for hit in hits if hit.codes is not None])
        name, units, data = "codes", "ADC code", codes.astype(choose_code_type(first.channels))
    else:
        units = "N, m/s^2" if first.has_force else "m/s^2"
        name, data = "samples", np.stack([hit.signals for hit in hits])
    write_dataset(raw, name, data, units, chunks=(1, *data.shape[1:]), **HDF5_COMPRESSION)
    write_dataset(raw, "lost_scans", [hit.lost_scans for hit in hits], "1")
    write_dataset(raw, "overload", [hit.overload for hit in hits], "1")
    write_dataset(raw, "accepted", [not flag for flag in decided], "1")
    raw["verdict"] = [flag.words for flag in flags]


def read_raw_hits(file: h5py.Group) -> tuple[tuple[Hit, ...], tuple[HitFlags, ...]]:
    """Read hits and their stored flags; raise KeyError where something is missing."""
    if "raw" not in file:
        return (), ()
    raw = file["raw"]
    rate, before = float(raw.attrs["sample_rate_hz"]), int(raw.attrs["pre_trigger_samples"])
    lost = raw["lost_scans"][()].tolist()
    overload = raw["overload"][()].tolist() if "overload" in raw else [0] * len(lost)  # not in the first files
    flags = tuple(HitFlags.from_words(words) for words in raw["verdict"].asstr()[()])
    states = [{"lost_scans": n, "overload": mask} for n, mask in zip(lost, overload, strict=True)]
    rows = raw["codes" if "codes" in raw else "samples"][()]
    if "codes" in raw:
        channels = tuple(read_channel(raw[f"channel_{i}"].attrs) for i in range(rows.shape[1]))
        coded = zip(rows, states, strict=True)
        return tuple(Hit.from_codes(codes, channels, rate, before, **state) for codes, state in coded), flags
    forces = rows[:, 0] if rows.shape[1] > 1 else rows[:, :0, 0]
    sampled = zip(forces, rows[:, -1], states, strict=True)
    return tuple(Hit(force, response, rate, before, **state) for force, response, state in sampled), flags
