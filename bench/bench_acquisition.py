"""Speed of the way from the wire to the verdict, each part beside what it cannot be faster than, one BLAS thread.

    python -m pip install -e .[bench]      (in an environment of its own)
    python bench/bench_acquisition.py [--seconds 60]

Live: 2 channels x 102.4 kS/s x 16 bit through a pseudo-terminal, the emulator in a process of its own; one hit a
second, each checked and averaged with the nine before it. The CPU time is that of the receiving process, all threads.
"""

from __future__ import annotations

import argparse
import os
import platform
import subprocess
import sys
import time
from collections.abc import Callable, Mapping, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from threadpoolctl import threadpool_limits

from acquisition import Channel, Hit, TapsEmulator, TapsSource, Trigger, capture_hits, check_hit, estimate_frf
from acquisition.taps import Frame, FrameDecoder, MessageType, encode_data, encode_frame
from acquisition.taps_stream import ScanStream

RATE = 102_400.0
CHANNELS = (Channel("force", 2.25e-3, 5.0), Channel("acceleration", 1.02e-3, 5.0))
TRIGGER = Trigger(level=20.0, n_samples=65_536, pre_trigger=1024)
PERIOD = 102_400
"""One hit in so many scans."""
CROSSING = 30_000
"""Near here in each period."""
AVERAGED = 10
ROUNDS = 25


class Received(NamedTuple):
    """What came of a stream."""

    scans: int
    lost: int
    hits: int


Receiver = Callable[[str, float], Received]
"""(port, seconds): takes a stream for so long."""


def one_period(seed: int = 1) -> NDArray[np.float64]:
    """Force (N) and acceleration (m/s^2) of one hit, with noise, shape (2, PERIOD)."""
    noise = np.random.default_rng(seed).normal(scale=[[0.1], [2.0]], size=(2, PERIOD))
    width = 70
    noise[0, CROSSING : CROSSING + width] += 250 * np.sin(np.pi * np.arange(width) / width) ** 4
    time_ = np.arange(PERIOD - CROSSING) / RATE
    noise[1, CROSSING:] += 900 * np.exp(-2 * np.pi * 1722 * 0.029 * time_) * np.sin(2 * np.pi * 1722 * time_)
    return noise


def emulate() -> None:
    """The emulator's process: tells its port, serves until its input is closed."""
    signal = np.tile(one_period(), 2)
    with TapsEmulator(lambda first, n: signal[:, first % PERIOD : first % PERIOD + n], CHANNELS, RATE) as device:
        print(device.port, flush=True)
        sys.stdin.read()


def receive_hits(port: str, seconds: float) -> Received:
    """The live test without its screen: capture, verdict, average of the last ten hits."""
    hits: list[Hit] = []
    taken = 0
    ends = time.monotonic() + seconds
    with TapsSource(port) as source:
        source.start()
        for hit in capture_hits(source, TRIGGER):
            taken += 1
            if not check_hit(hit):
                hits = [*hits[1 - AVERAGED :], hit]
                estimate_frf(hits)
            if time.monotonic() > ends:
                break
        status = source.status
        assert status is not None
        return Received(status.samples_taken, source.lost_scans + source.overruns + status.overruns, taken)


def live(seconds: float, receive: Receiver = receive_hits) -> None:
    with subprocess.Popen(
        [sys.executable, __file__, "--emulate"], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
    ) as device:
        assert device.stdout is not None
        port = device.stdout.readline().strip()
        wall, cpu = time.monotonic(), time.process_time()
        received = receive(port, seconds)
        wall, cpu = time.monotonic() - wall, time.process_time() - cpu
        device.communicate("")
    print(f"live, 2 x {RATE:g} S/s x 16 bit for {wall:.0f} s: {received.scans} scans, {received.lost} lost, ", end="")
    print(f"{received.hits} hits, {100 * cpu / wall:.1f} % of one core")


def latency(n_hits: int = 12) -> None:
    """From the end of a hit's record to its verdict and the new average; the clock is that of the frames sent."""
    signal, sent = np.tile(one_period(), 2), {}

    def timed(first: int, n: int) -> NDArray[np.float64]:
        sent[first + n] = time.monotonic()
        return signal[:, first % PERIOD : first % PERIOD + n]

    verdicts, hits = [], []
    with TapsEmulator(timed, CHANNELS, RATE) as device, TapsSource(device.port) as source:
        source.start()
        for hit in capture_hits(source, TRIGGER):
            check_hit(hit)
            hits.append(hit)
            estimate_frf(hits[-AVERAGED:])
            verdicts.append(time.monotonic())
            if len(hits) == n_hits:
                break
    began = min(at - scan / RATE for scan, at in sent.items())
    crossing = CROSSING + int(np.argmax(one_period()[0, CROSSING:] >= TRIGGER.level))
    ends = crossing - TRIGGER.pre_trigger + TRIGGER.n_samples + PERIOD * np.arange(n_hits)
    late = 1e3 * (np.array(verdicts) - began - ends / RATE)
    print(f"from the end of a record to its verdict and the new average: median {np.median(late):.0f} ms, ", end="")
    print(f"largest of {n_hits}: {late.max():.0f} ms")


def decode(megabytes: float = 64.0) -> None:
    codes = np.random.default_rng(1).integers(-32768, 32767, size=(2, 512), dtype=np.int32)
    frames = [
        encode_frame(Frame(MessageType.DATA, i, encode_data(512 * i, codes), session=1))
        for i in range(int(megabytes * 1e6 / 2080))
    ]
    stream = b"".join(frames)
    decoder, scans, taken = FrameDecoder(), ScanStream(1, 2), 0
    start = time.process_time()
    for at in range(0, len(stream), 65_536):
        for frame in decoder.feed(stream[at : at + 65_536]):
            block = scans.accept(frame)
            taken += block.codes.shape[1] if block is not None else 0
    seconds = time.process_time() - start
    assert (taken, scans.lost_scans) == (512 * len(frames), 0)
    print(f"decoding: {len(stream) / seconds / 1e6:.0f} MB/s")


def average() -> None:
    """Averaged H1 and coherence of ten hits, beside the bare batched rfft of their samples and beside pyFRF."""
    records = [one_period(seed)[:, CROSSING - 1024 : CROSSING - 1024 + TRIGGER.n_samples] for seed in range(AVERAGED)]
    hits = [Hit(force, response, RATE, TRIGGER.pre_trigger) for force, response in records]
    batch = np.stack(records)
    ways: dict[str, Callable[[], object]] = {
        "bare rfft of one array (10, 2, 65536)": lambda: np.fft.rfft(batch),
        "the same, gathered from ten hits": lambda: np.fft.rfft([[hit.force, hit.acceleration] for hit in hits]),
        "lobewatch estimate_frf": lambda: estimate_frf(hits),
    }
    try:
        import pyFRF
    except ImportError:
        print('pyFRF is not installed: python -m pip install -e ".[bench]"')
    else:

        def theirs() -> object:
            frf = pyFRF.FRF(int(RATE), batch[:, 0], batch[:, 1], exc_type="f", resp_type="a", frf_estimator="H1")
            return frf.get_H1(), frf.get_coherence()

        ways[f"pyFRF {pyFRF.__version__}, all hits at once"] = theirs
    cpu: dict[str, list[float]] = {name: [] for name in ways}
    for _ in range(ROUNDS):
        for name, way in ways.items():
            start = time.process_time()
            way()
            cpu[name].append(time.process_time() - start)
    table(cpu)


def table(cpu: Mapping[str, Sequence[float]]) -> None:
    print(f"averaged H1 and coherence of {AVERAGED} hits x 2 x {TRIGGER.n_samples}, CPU time, {ROUNDS} rounds")
    bare = cpu[next(iter(cpu))]
    for name, seconds in cpu.items():
        ratio = np.median(np.array(seconds) / bare)
        print(f"  {name:40}{1e3 * float(np.median(seconds)):8.1f} ms{ratio:8.2f} x")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("--seconds", type=float, default=60.0, help="length of the live stream")
    parser.add_argument("--emulate", action="store_true", help=argparse.SUPPRESS)
    arguments = parser.parse_args()
    if arguments.emulate:
        emulate()
        return
    print(f"Python {platform.python_version()}, numpy {np.__version__}, {os.cpu_count()} cores, one BLAS thread")
    decode()
    average()
    latency()
    live(arguments.seconds)


if __name__ == "__main__":
    with threadpool_limits(limits=1):
        main()
