"""Speed from the wire to the hit verdict, each part against its lower bound, one BLAS thread.

    python -m pip install -e .[bench]      (in an environment of its own)
    python bench/bench_acquisition.py [--seconds 60]

Live: 2 channels x 102.4 kS/s x 16 bit through a pseudo-terminal into a whole tap test (reader, trigger, verdicts, disk,
mean, curves) with its screen's server, one hit a second; the emulator and the page that follows the test run in
processes of their own. The CPU time is that of the process under test, all threads, from the first TAP on.
"""

from __future__ import annotations

import argparse
import asyncio
import contextlib
import json
import os
import platform
import re
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from datetime import UTC, datetime
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory

import aiohttp
import numpy as np
from numpy.typing import NDArray
from race import Race
from threadpoolctl import threadpool_limits

from acquisition import Channel, Circumstances, Hit, TapsEmulator, TapsSource, Trigger, check_hit, estimate_frf
from acquisition.taps.protocol import Frame, FrameDecoder, MessageType, encode_data, encode_frame
from acquisition.taps.source import ScanStream
from lobewatch.machine.folder import MachineFolder
from lobewatch.machine.folder_files import make_machine_folder
from lobewatch.screen import ScreenServer
from lobewatch.tap.hit_loop import TapStopped
from lobewatch.tap.session import TapSession
from lobewatch.tap.state import TapStep

RATE = 102_400.0
CHANNELS = (Channel("force", 2.25e-3, 5.0), Channel("acceleration", 1.02e-3, 5.0))
TRIGGER = Trigger(level=20.0, n_samples=65_536, pre_trigger=1024)
PERIOD = 102_400
"""One hit in so many scans."""
CROSSING = 30_000
"""Near here in each period."""
AVERAGED = 10
ROUNDS = 25
QUIET = 8 * PERIOD
"""Scans before the first hit, for the check of the rate and the self-check."""


def one_period(seed: int = 1, hammer: bool = True) -> NDArray[np.float64]:
    """Force (N) and acceleration (m/s^2) of one hit, with noise, or of the noise alone, shape (2, PERIOD)."""
    noise = np.random.default_rng(seed).normal(scale=[[0.1], [2.0]], size=(2, PERIOD))
    if not hammer:
        return noise
    width = 70
    noise[0, CROSSING : CROSSING + width] += 250 * np.sin(np.pi * np.arange(width) / width) ** 4
    time_ = np.arange(PERIOD - CROSSING) / RATE
    noise[1, CROSSING:] += 900 * np.exp(-2 * np.pi * 1722 * 0.029 * time_) * np.sin(2 * np.pi * 1722 * time_)
    return noise


def emulate() -> None:
    """The emulator's process: tells its port, serves until its input is closed, tells when each record ended."""
    hits, quiet = (np.tile(one, 2) for one in (one_period(), one_period(hammer=False)))
    crossing = CROSSING + int(np.argmax(hits[0, CROSSING:] >= TRIGGER.level))
    last = crossing - TRIGGER.pre_trigger + TRIGGER.n_samples - 1
    sent: list[float] = []

    def signal(first: int, n: int) -> NDArray[np.float64]:
        if first >= QUIET and (last - first) % PERIOD < n:
            sent.append(time.monotonic())
        at = first % PERIOD
        return (hits if first >= QUIET else quiet)[:, at : at + n]

    with TapsEmulator(signal, CHANNELS, RATE) as device:
        print(device.port, flush=True)
        sys.stdin.read()
    print(json.dumps(sent))


def watch(url: str) -> None:
    """The page's process: follows the test until it ends, then tells when each verdict came."""
    shown: list[float] = []

    async def follow() -> None:
        origin, _, token = url.partition("/#token=")
        names = ("lobewatch", f"token.{token}")
        kind = ""
        async with (
            aiohttp.ClientSession() as client,
            client.ws_connect(f"{origin}/feed", protocols=names, headers={"Origin": origin}, max_msg_size=0) as feed,
        ):
            print("connected", flush=True)
            async for message in feed:
                now = time.monotonic()
                if message.type is not aiohttp.WSMsgType.TEXT:
                    continue
                before, kind = kind, json.loads(message.data).get("kind", kind)
                if kind != before and kind in ("good", "refused"):
                    shown.append(now)

    asyncio.run(follow())
    print(json.dumps(shown))


def live(seconds: float) -> None:
    """CPU share and lost scans of a live tap test, and from the end of each record to its verdict on the page."""
    sources: list[TapsSource] = []
    device = helper("--emulate")
    port = line_of(device)

    def open_device() -> TapsSource:
        sources.append(TapsSource(port))
        return sources[-1]

    with TemporaryDirectory() as directory:
        folder = machine_folder(Path(directory) / "machine")
        about = Circumstances("bench", datetime.now(UTC), "reference", machine_toml=folder.toml.read_text("utf-8"))
        session = TapSession(folder, open_device, about)
        with ScreenServer(session) as server:
            page = helper("--watch", server.url)
            line_of(page)
            test = threading.Thread(target=until_stopped, args=(session,))
            test.start()
            while session.state.word is not TapStep.TAP and test.is_alive():
                time.sleep(0.05)
            wall, cpu = time.monotonic(), time.process_time()
            test.join(seconds)
            wall, cpu = time.monotonic() - wall, time.process_time() - cpu
            session.stop()
            test.join()
    shown, sent = (np.array(json.loads(process.communicate()[0])) for process in (page, device))
    status = sources[-1].status
    assert status is not None
    lost = sources[-1].lost_scans + sources[-1].overruns + status.overruns
    late = 1e3 * (shown - sent[np.searchsorted(sent, shown) - 1])
    print(
        f"live, 2 x {RATE:g} S/s x 16 bit, with screen, for {wall:.0f} s: {status.samples_taken} scans, {lost} lost, ",
        end="",
    )
    print(f"{session.state.good} good hits, {100 * cpu / wall:.1f} % of one core")
    print(f"from the end of a record to its verdict on the page: median {np.median(late):.0f} ms, ", end="")
    print(f"largest of {late.size}: {late.max():.0f} ms")


def machine_folder(path: Path) -> MachineFolder:
    """Make the example machine folder with record length and trigger of this bench."""
    make_machine_folder(path, "surrogate_machine.toml")
    folder = MachineFolder(path)
    own = {
        "hits": 1000,
        "record_s": TRIGGER.n_samples / RATE,
        "pre_trigger_s": TRIGGER.pre_trigger / RATE,
        "trigger_n": TRIGGER.level,
    }
    text = folder.toml.read_text("utf-8")
    for key, value in own.items():
        text = re.sub(rf"^{key} = [\d.]+", f"{key} = {value}", text, flags=re.MULTILINE)
    folder.toml.write_text(text, "utf-8")
    return MachineFolder(path)


def until_stopped(session: TapSession) -> None:
    with contextlib.suppress(TapStopped):
        session.run()


def helper(*arguments: str) -> subprocess.Popen[str]:
    """This file in a process of its own."""
    command = [sys.executable, __file__, *arguments]
    return subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)


def line_of(process: subprocess.Popen[str]) -> str:
    return process.stdout.readline().strip() if process.stdout else ""


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


def ten_records(length: int = TRIGGER.n_samples) -> list[NDArray[np.float64]]:
    """Force and acceleration of ten hits, each of shape (2, length)."""
    first = CROSSING - TRIGGER.pre_trigger
    return [one_period(seed)[:, first : first + length] for seed in range(AVERAGED)]


NEW_HIT_LENGTHS = (16_384, 65_536)
"""Samples of new hits, of which nothing is known from an earlier evaluation."""


def races_of_new_hits() -> Iterator[Race]:
    """Compare H1 and verdicts of new hits, as a file gives them, with the bare transforms of their samples."""
    for length in NEW_HIT_LENGTHS:
        batch, size = np.stack(ten_records(length)), f"{AVERAGED} new hits, {length} samples"
        bare = partial(np.fft.rfft, batch)
        yield Race(f"H1 and coherence, {size}", partial(_average_new, batch), "numpy rfft only", bare)
        yield Race(f"hit verdicts, {size}", partial(_check_new, batch), "numpy rfft only", bare)


def _average_new(records: NDArray[np.float64]) -> object:
    return estimate_frf([Hit(force, response, RATE) for force, response in records])


def _check_new(records: NDArray[np.float64]) -> object:
    return [check_hit(Hit(force, response, RATE)) for force, response in records]


def races() -> Iterator[Race]:
    """Compare with pyFRF and with the bare transforms."""
    records, size = ten_records(), f"{AVERAGED} hits"
    hits, batch = [Hit(f, a, RATE, TRIGGER.pre_trigger) for f, a in records], np.stack(records)

    yield Race(f"H1 and coherence, {size}", lambda: estimate_frf(hits), "numpy rfft only", lambda: np.fft.rfft(batch))
    yield from races_of_new_hits()
    import pyFRF

    whole = pyFRF.FRF(int(RATE), exc_type="f", resp_type="a", fft_len=TRIGGER.n_samples)

    def theirs() -> object:
        frf = pyFRF.FRF(int(RATE), batch[:, 0], batch[:, 1], exc_type="f", resp_type="a", frf_estimator="H1")
        return frf.get_H1(), frf.get_coherence()

    yield Race(f"H1 and coherence, {size}", lambda: estimate_frf(hits), "pyFRF", theirs)

    def checked() -> object:
        return [whole.is_data_ok(f, a) for f, a in records]

    yield Race(f"hit verdicts, {size}", partial(_check_new, batch), "pyFRF, two checks", checked)


def average() -> None:
    """Averaged H1 and coherence of ten hits, against the bare batched rfft of their samples and against pyFRF."""
    records = ten_records()
    hits = [Hit(force, response, RATE, TRIGGER.pre_trigger) for force, response in records]
    batch = np.stack(records)
    ways: dict[str, Callable[[], object]] = {
        "bare rfft of one array (10, 2, 65536)": lambda: np.fft.rfft(batch),
        "the same, gathered from ten hits": lambda: np.fft.rfft([[hit.force, hit.acceleration] for hit in hits]),
        "lobewatch estimate_frf": lambda: estimate_frf(hits),
        "lobewatch estimate_frf, hits of a file": lambda: estimate_frf([Hit(f, a, RATE) for f, a in records]),
        "lobewatch check_hit of ten of a file": lambda: [check_hit(Hit(f, a, RATE)) for f, a in records],
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
    parser.add_argument("--watch", metavar="URL", help=argparse.SUPPRESS)
    arguments = parser.parse_args()
    if arguments.emulate:
        emulate()
        return
    if arguments.watch:
        watch(arguments.watch)
        return
    print(f"Python {platform.python_version()}, numpy {np.__version__}, {os.cpu_count()} cores, one BLAS thread")
    decode()
    average()
    live(arguments.seconds)


if __name__ == "__main__":
    with threadpool_limits(limits=1):
        main()
