"""Hits in HDF5: their set-up, ADC codes or samples, and the verdict on each."""

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


class HitSettings(NamedTuple):
    """What all hits of a test are recorded with."""

    sample_rate: float
    """Samples a second (Hz)."""
    pre_trigger: int
    """Samples before the trigger."""
    channels: tuple[Channel, ...]
    """Channels of the codes; empty where the hits are samples."""

    @classmethod
    def from_hit(cls, hit: Hit) -> HitSettings:
        """That of a hit."""
        return cls(hit.sample_rate, hit.pre_trigger, (hit.channels or ()) if hit.codes is not None else ())


def write_dataset(group: h5py.Group, name: str, data: Any, units: str, **options: Any) -> None:
    """A dataset with its units."""
    group.create_dataset(name, data=data, **options).attrs["units"] = units


def write_raw_hits(file: h5py.Group, hits: Sequence[Hit], flags: Sequence[HitFlags]) -> None:
    """Hits and the verdict on each, as a group of their own; nothing where there are none."""
    if not hits:
        return
    raw = file.create_group("raw")
    write_hit_settings(raw, HitSettings.from_hit(hits[0]))
    write_hits(raw, hits, flags)


def write_hit_settings(raw: h5py.Group, set_up: HitSettings) -> None:
    """The set-up of hits."""
    raw.attrs.update(sample_rate_hz=set_up.sample_rate, pre_trigger_samples=set_up.pre_trigger)
    for i, channel in enumerate(set_up.channels):
        raw.create_group(f"channel_{i}").attrs.update(
            {field.name: getattr(channel, field.name) for field in fields(Channel)}
        )


def write_hits(raw: h5py.Group, hits: Sequence[Hit], flags: Sequence[HitFlags]) -> None:
    """Hits of one set-up, beside it, and the verdict on each."""
    first = hits[0]
    if first.codes is not None and first.channels is not None:
        word = np.int16 if max(channel.adc_bits for channel in first.channels) <= 16 else np.int32
        codes = np.stack([hit.codes for hit in hits if hit.codes is not None]).astype(word)
        write_dataset(raw, "codes", codes, "ADC code", chunks=(1, *codes.shape[1:]), **HDF5_COMPRESSION)
    else:
        samples = np.stack([hit.signals for hit in hits])
        write_dataset(
            raw,
            "samples",
            samples,
            "N, m/s^2" if first.has_force else "m/s^2",
            chunks=(1, *samples.shape[1:]),
            **HDF5_COMPRESSION,
        )
    write_dataset(raw, "lost_scans", [hit.lost_scans for hit in hits], "1")
    write_dataset(raw, "overload", [hit.overload for hit in hits], "1")
    write_dataset(raw, "accepted", [not flag for flag in flags], "1")
    raw["verdict"] = [flag.words for flag in flags]


def read_raw_hits(file: h5py.Group) -> tuple[tuple[Hit, ...], tuple[HitFlags, ...]]:
    """Hits and the verdicts of then; KeyError where something is missing."""
    if "raw" not in file:
        return (), ()
    raw = file["raw"]
    rate, before = float(raw.attrs["sample_rate_hz"]), int(raw.attrs["pre_trigger_samples"])
    lost = raw["lost_scans"][()].tolist()
    overload = raw["overload"][()].tolist() if "overload" in raw else [0] * len(lost)  # not in the first files
    flags = tuple(HitFlags.from_words(words) for words in raw["verdict"].asstr()[()])
    if "codes" in raw:
        rows = raw["codes"][()]
        channels = tuple(_read_channel(raw[f"channel_{i}"]) for i in range(rows.shape[1]))
        coded = zip(rows, lost, overload, strict=True)
        return tuple(Hit.from_codes(codes, channels, rate, before, n, mask) for codes, n, mask in coded), flags
    sampled = zip(raw["samples"][()], lost, overload, strict=True)
    nothing = np.empty(0)
    return tuple(
        Hit(signals[0] if len(signals) > 1 else nothing, signals[-1], rate, before, n, overload=mask)
        for signals, n, mask in sampled
    ), flags


def _read_channel(group: h5py.Group) -> Channel:
    return Channel(**convert_to_plain(group.attrs))


def convert_to_plain(attributes: h5py.AttributeManager) -> dict[str, Any]:
    """Attributes as values of Python."""
    return {name: value.item() if isinstance(value, np.generic) else value for name, value in attributes.items()}
