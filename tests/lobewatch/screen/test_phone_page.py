"""The page that takes a recording of a phone: real encoded files through HTTP, and all that must be refused."""

from __future__ import annotations

import http.client
import io
import json
import re
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from importlib import resources
from pathlib import Path
from typing import Any
from urllib.parse import urlencode

import numpy as np
import pytest
import soundfile

from acquisition.arrays import Floats
from acquisition.errors import DataError
from acquisition.files.cut_file import CutSignal
from acquisition.files.readers.read_audio import decode_audio
from acquisition.subprocess_guard import run_in_subprocess
from lobewatch.logbook import Logbook
from lobewatch.logbook.cut_comparison import store_recorded_cuts
from lobewatch.logbook.heard_cuts import ASSUMED_RANGE, CutFileRequest, hear_signal
from lobewatch.machine import MachineFolder
from lobewatch.machine.folder_files import make_machine_folder
from lobewatch.screen import DashboardServer, RecordingServer, phone_page, uploaded_recording

RATE, RPM, FLUTES, CHATTER = 16000, 18000.0, 2, 1370.0
"""Sample rate (Hz), speed (rpm), flutes and chatter frequency (Hz) of the recordings."""
CUT = {"teeth": FLUTES, "speed_rpm": RPM, "low_rpm": 8000, "high_rpm": 24000}
Browser = Any
"""Chromium on one page: Browser of conftest.py."""


def sound_of_a_cut(chatter: float | None = CHATTER, seed: int = 0) -> Floats:
    """Return one second of air, two of cutting and half a second of air, as shares of the full scale."""
    random, seconds = np.random.default_rng(seed), np.arange(round(3.5 * RATE)) / RATE
    passing = FLUTES * RPM / 60
    lines = [(k * passing, 0.2 / k) for k in range(1, 12)]
    if chatter:
        lines += [(chatter + k * passing, 0.3 * 0.3 ** abs(k)) for k in range(-2, 4)]
    cut = sum(height * np.sin(2 * np.pi * hz * seconds + random.uniform(0, 6)) for hz, height in lines)
    sound = 0.01 * random.standard_normal(seconds.size) + np.where((seconds > 1) & (seconds < 3), cut, 0.0)
    return np.asarray(0.6 * sound / np.max(np.abs(sound)))


def encode(sound: Any, file_format: str, subtype: str | None = None, rate: int = RATE) -> bytes:
    file = io.BytesIO()
    soundfile.write(file, sound, rate, format=file_format, subtype=subtype)
    return file.getvalue()


def send(
    server: RecordingServer | DashboardServer, content: bytes, path: str = "/recording", **changes: Any
) -> tuple[int, dict[str, Any]]:
    """Send a recording as the page does; changes: other headers, or other values of the cut."""
    headers = {"Origin": server.origin, "Authorization": f"Bearer {server.token}"} | changes.pop("headers", {})
    connection = http.client.HTTPConnection(server.origin.removeprefix("http://"), timeout=60)
    connection.request("POST", f"{path}?{urlencode(CUT | changes)}", content, headers)
    answer = connection.getresponse()
    text = answer.read().decode()
    connection.close()
    return answer.status, json.loads(text)


OTHER_FORMATS = (("WAV", None), ("WAV", "ULAW"), ("FLAC", None), ("OGG", "VORBIS"))
"""Formats and codings of soundfile besides MP3."""


@pytest.fixture(scope="module")
def server() -> Iterator[RecordingServer]:
    with RecordingServer() as running:
        yield running


@pytest.mark.parametrize(
    ("file_format", "subtype"),
    [("MP3", None), *(pytest.param(*each, marks=pytest.mark.long) for each in OTHER_FORMATS)],
    ids=str,
)
def test_chatter_in_an_encoded_recording_names_the_next_speeds(
    server: RecordingServer, file_format: str, subtype: str | None
) -> None:
    """Tooth passing is near f_c / k: within 3 %, as the chatter frequency is a little above that of the mode."""
    status, told = send(server, encode(sound_of_a_cut(), file_format, subtype))
    assert (status, told["word"], told["reason"]) == (200, "chatter", "")
    assert told["chatter_frequency_hz"] == pytest.approx(CHATTER, abs=1.0)
    assert [speed["lobe"] for speed in told["next_speeds"]] == [2, 3, 4]
    for speed in told["next_speeds"]:
        assert speed["speed_rpm"] == pytest.approx(60 * CHATTER / (FLUTES * speed["lobe"]), rel=0.03)
        assert 8000 < speed["speed_rpm"] < 24000


@pytest.mark.parametrize("container", ["mp4", "webm"])
def test_an_m4a_or_webm_recording_is_decoded_as_it_was_encoded(container: str) -> None:
    av = pytest.importorskip("av")
    wave = 0.3 * np.sin(2 * np.pi * 440 * np.arange(48000) / 48000).astype(np.float32)
    file = io.BytesIO()
    with av.open(file, "w", format=container) as output:
        stream = output.add_stream("aac" if container == "mp4" else "libopus", rate=48000)
        stream.layout = "mono"
        frame = av.AudioFrame.from_ndarray(wave[np.newaxis], format="fltp", layout="mono")
        frame.sample_rate = 48000
        for packet in [*stream.encode(frame), *stream.encode(None)]:
            output.mux(packet)
    rate, (sound,) = decode_audio(file.getvalue(), "recording")
    assert rate == 48000
    assert np.std(sound[4800:-4800]) == pytest.approx(0.3 / np.sqrt(2), rel=0.03)
    assert np.argmax(np.abs(np.fft.rfft(sound[:48000]))) == 440
    assert decode_audio(file.getvalue(), "recording", 0.5)[1].shape[1] == pytest.approx(24000, abs=4096)
    with pytest.raises(DataError):
        decode_audio(file.getvalue()[:300], "recording")


def test_without_a_package_for_m4a_one_sentence_says_so(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "av", None)
    with pytest.raises(DataError, match=r"lobewatch\[phone\]"):
        decode_audio(b"\0\0\0\x1cftypM4A " + bytes(64), "recording")


def test_lossy_coding_of_a_clipped_recording_stays_at_the_full_scale() -> None:
    """A decoder overshoots the rails, and three equal samples at an extreme are the sign of an overload."""
    clipped = np.clip(3 * sound_of_a_cut(), -1, 1)
    _, (sound,) = decode_audio(encode(clipped, "OGG", "VORBIS"), "recording")
    assert np.max(np.abs(sound)) == 1.0
    assert np.mean(np.abs(sound) == 1.0) > 0.02


HOSTILE = (b"", b"hello" * 100, b"OggS" + bytes(500), b"\0\0\0\x1cftypM4A " + bytes(64), b"\x1aE\xdf\xa3" + bytes(64))
"""Empty, a text, and nothing after the signatures of OGG, M4A and WebM."""


@pytest.mark.parametrize("content", HOSTILE, ids=["empty", "text", "ogg", "m4a", "webm"])
def test_a_damaged_file_is_refused_without_an_address_in_memory(content: bytes) -> None:
    with pytest.raises(DataError, match=r"^recording: ") as refused:
        decode_audio(content, "recording")
    assert "0x" not in str(refused.value)


def test_a_hostile_file_is_refused_in_a_sentence(server: RecordingServer) -> None:
    content = b"OggS" + np.random.default_rng(0).bytes(5000)
    status, told = send(server, content)
    assert (status, told["code"]) == (422, "unreadable")
    assert "Traceback" not in told["error"]


def test_a_program_of_its_own_is_ended_when_it_computes_for_too_long(
    server: RecordingServer, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Four minutes of noise take more than the second that is allowed here."""
    monkeypatch.setattr(uploaded_recording, "MAX_CPU_SECONDS", 0.1)
    noise = np.random.default_rng(0).integers(-9000, 9000, 12_000_000, dtype=np.int16)
    status, told = send(server, encode(noise, "WAV", rate=48000))
    assert (status, told["code"]) == (422, "too-slow")


def test_a_crash_and_too_long_a_wait_are_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    def fail(error: Exception) -> str:
        monkeypatch.setattr(uploaded_recording, "run_in_subprocess", lambda *_, **__: (_ for _ in ()).throw(error))
        return str(uploaded_recording.evaluate_upload(b"", uploaded_recording.parse_uploaded_cut(TEXTS))["code"])

    assert fail(subprocess.TimeoutExpired("lobewatch", 1)) == "too-slow"
    assert fail(subprocess.CalledProcessError(-11, "lobewatch")) == "unreadable"
    assert fail(subprocess.CalledProcessError(1, "lobewatch")) == "failed"
    monkeypatch.delattr("signal.SIGXCPU", raising=False)  # as on Windows
    assert fail(subprocess.CalledProcessError(1, "lobewatch")) == "failed"


TEXTS = {"teeth": "2", "speed_rpm": "18000"}
"""Values as the page sends them."""


def test_a_recording_that_unpacks_to_hours_is_too_long(server: RecordingServer) -> None:
    """48 KB of FLAC with 11 min of silence; decoding ends after five."""
    content = encode(np.zeros(8000 * 660, np.int16), "FLAC", rate=8000)
    assert len(content) < 100_000
    status, told = send(server, content)
    assert (status, told["code"]) == (422, "too-long")


@pytest.mark.long
def test_a_sample_rate_below_that_of_a_telephone_is_refused(server: RecordingServer) -> None:
    status, told = send(server, encode(np.zeros(4000), "WAV", rate=4000))
    assert (status, told["code"]) == (422, "sample-rate")


@pytest.mark.parametrize("declared", [True, False], ids=["declared", "chunked"])
def test_a_file_that_is_too_large_is_not_read(
    server: RecordingServer, monkeypatch: pytest.MonkeyPatch, declared: bool
) -> None:
    monkeypatch.setattr(phone_page, "MAX_UPLOAD_BYTES", 100_000)
    content = bytes(150_000)
    status, told = send(server, content if declared else iter([content]))  # type: ignore[arg-type]
    assert (status, told["code"]) == (413, "too-large")
    assert "MB" in told["error"]


def test_an_upload_that_takes_too_long_is_refused(server: RecordingServer, monkeypatch: pytest.MonkeyPatch) -> None:
    def halting() -> Iterator[bytes]:
        yield b"sound"
        time.sleep(0.5)
        yield b"sound"

    monkeypatch.setattr(phone_page, "MAX_UPLOAD_SECONDS", 0.05)
    status, told = send(server, halting())  # type: ignore[arg-type]
    assert (status, told["code"]) == (408, "too-slow")


def test_one_recording_is_evaluated_at_a_time(server: RecordingServer, monkeypatch: pytest.MonkeyPatch) -> None:
    begun, end = threading.Event(), threading.Event()

    def wait(*_: Any) -> dict[str, Any]:
        begun.set()
        end.wait(10)
        return {}

    monkeypatch.setattr(phone_page, "evaluate_upload", wait)
    with ThreadPoolExecutor() as other:
        first = other.submit(send, server, b"sound")
        begun.wait(10)
        status, told = send(server, b"sound")
        end.set()
    assert (status, told["code"]) == (409, "busy")
    assert first.result() == (200, {})


def test_a_recording_without_a_cut_is_answered_in_json_for_browsers(server: RecordingServer) -> None:
    """Values that are unknown are null, as JSON has neither NaN nor infinity."""
    status, told = send(server, encode(np.zeros(RATE), "WAV"))
    assert (status, told["word"], told["reason"]) == (200, "cannot tell", "no-cut")
    json.dumps(told, allow_nan=False)


@pytest.mark.parametrize(
    ("headers", "status"),
    [
        ({"Authorization": ""}, 401),
        ({"Authorization": "Bearer wrong-token-wrong"}, 401),
        ({"Origin": "http://evil.example"}, 403),
        ({"Origin": ""}, 403),
        ({"Host": "evil.example"}, 403),
    ],
    ids=str,
)
def test_nothing_is_evaluated_without_the_token_or_for_another_page(
    server: RecordingServer, monkeypatch: pytest.MonkeyPatch, headers: dict[str, str], status: int
) -> None:
    monkeypatch.setattr(phone_page, "evaluate_upload", lambda *_: pytest.fail("evaluated"))
    assert send(server, b"sound", headers=headers)[0] == status


def test_the_read_only_address_evaluates_nothing(server: RecordingServer) -> None:
    assert send(server, b"sound", headers={"Authorization": f"Bearer {server.watch_token}"})[0] == 403


@pytest.mark.parametrize(
    "changes",
    [
        {"teeth": 0},
        {"teeth": "two"},
        {"teeth": 2.5},
        {"speed_rpm": -1},
        {"speed_rpm": "nan"},
        {"speed_rpm": "inf"},
        {"low_rpm": 24000, "high_rpm": 8000},
        {"depth_mm": 0},
        {"file": "/etc/passwd"},
    ],
    ids=str,
)
def test_an_impossible_value_is_named_before_the_recording_is_read(
    server: RecordingServer, monkeypatch: pytest.MonkeyPatch, changes: dict[str, Any]
) -> None:
    monkeypatch.setattr(phone_page, "evaluate_upload", lambda *_: pytest.fail("evaluated"))
    status, told = send(server, b"sound", **changes)
    assert status == 409
    assert told["error"].endswith(".")


def test_the_page_states_the_range_of_speeds_that_is_assumed() -> None:
    page = resources.files("lobewatch.screen").joinpath("static/phone.html").read_text("utf-8")
    found = re.findall(r'name="(?:low|high)_rpm".*placeholder="([\d.]+) \u00d7 speed"', page)
    assert found == [*map(str, ASSUMED_RANGE)]


def test_the_dashboard_serves_the_page_too(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(phone_page, "evaluate_upload", lambda content, cut: {"size": len(content), "teeth": cut.teeth})
    make_machine_folder(tmp_path / "mill", "surrogate_machine.toml")
    with DashboardServer(tmp_path) as server:
        assert send(server, b"sound", "/phone/recording", headers={"Authorization": ""})[0] == 401
        assert send(server, b"sound", "/phone/recording", teeth=0)[0] == 409
        assert send(server, b"sound", "/phone/recording") == (200, {"size": 5, "teeth": FLUTES})


def journal_cuts(folder: Path) -> list[Any]:
    return list(Logbook.open(folder).files.contents.cuts)


@pytest.fixture
def mill(tmp_path: Path) -> Path:
    """Machine that was never tapped, with a program of the recorded cut."""
    make_machine_folder(tmp_path / "mill", "surrogate_machine.toml")
    return tmp_path / "mill"


def test_a_cut_of_a_chosen_machine_is_kept_and_the_next_speed_uses_all_cuts(mill: Path) -> None:
    """Nothing is written without a choice, with half of one, for an unknown machine, or without the full token."""
    sound, again = (encode(sound_of_a_cut(seed=seed), "WAV") for seed in (0, 1))
    program = next(iter(Logbook.open(mill).machine.cut_tables))
    with DashboardServer(mill.parent) as server:
        teeth = Logbook.open(mill).machine.cut_tables[program].teeth
        chosen = {"machine": "mill", "program": program, "speed_rpm": RPM * FLUTES / teeth, "teeth": teeth}
        chosen |= {"low_rpm": 4000, "depth_mm": 1}
        refused = [
            send(server, sound, "/phone/recording")[0],
            send(server, sound, "/phone/recording", **chosen | {"program": ""})[0],
            send(server, sound, "/phone/recording", **chosen | {"machine": "../mill"})[0],
            send(server, sound, "/phone/recording", **chosen | {"teeth": teeth + 1})[0],
            send(
                server, sound, "/phone/recording", **chosen, headers={"Authorization": f"Bearer {server.watch_token}"}
            )[0],
        ]
        assert refused == [200, 409, 404, 422, 403]
        assert journal_cuts(mill) == []
        kept = [send(server, recording, "/phone/recording", **chosen) for recording in (sound, again, sound)]
        deeper = send(server, sound, "/phone/recording", **chosen | {"depth_mm": 2})
    assert (deeper[0], deeper[1]["code"]) == (422, "not-kept")
    assert [answer["saved"] for _, answer in kept] == [["c1"], ["c2"], ["c1"]], kept
    found = [(cut.id, cut.word, cut.by) for cut in journal_cuts(mill)]
    assert found == [("c1", "chatter", "microphone"), ("c2", "chatter", "microphone")]
    first, second, repeated = (answer["next_speeds"][0] for _, answer in kept)
    assert second["depth_mm"] == repeated["depth_mm"] < first["depth_mm"] == 1.0


def test_a_recording_that_is_stopped_after_its_cut_is_kept_says_so_and_keeps_it_once(
    mill: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    program, table = next(iter(Logbook.open(mill).machine.cut_tables.items()))
    speed = RPM * FLUTES / table.teeth
    entered = uploaded_recording.UploadedCut(table.teeth, speed, depth_mm=1, machine="mill", program=program)
    sound = encode(sound_of_a_cut(), "WAV")

    def stop(*arguments: str, **options: Any) -> bytes:
        run_in_subprocess(*arguments, **options)
        raise subprocess.TimeoutExpired("python", 0)

    with monkeypatch.context() as patched:
        patched.setattr(uploaded_recording, "run_in_subprocess", stop)
        stopped = uploaded_recording.evaluate_upload(sound, entered, mill)
    assert (stopped["code"], stopped["saved"]) == ("too-slow", ["c1"])
    assert uploaded_recording.evaluate_upload(sound, entered, mill)["saved"] == ["c1"]
    assert len(journal_cuts(mill)) == 1


def test_only_the_passes_that_are_not_kept_yet_are_stored(mill: Path) -> None:
    sound = np.concatenate([sound_of_a_cut(seed=seed) for seed in (0, 1)])
    signal, folder = CutSignal(sound, RATE, sensor="microphone"), MachineFolder(mill)
    passes, _ = hear_signal(signal, "two.wav", CutFileRequest(FLUTES, RPM, 1.0))
    first = store_recorded_cuts(folder, passes[:1], signal, None, "a")
    every = store_recorded_cuts(folder, passes, signal, None, "a", first)
    assert [cut.id for cut in every] == [cut.id for cut in journal_cuts(mill)] == ["c1", "c2"]
    assert len({(cut.at, cut.upload) for cut in journal_cuts(mill)}) == 1


SIZES = ((1280, 657), (820, 1180), (390, 844))
"""Desktop, tablet and phone (px)."""


def test_the_page_shows_chatter_and_enters_the_next_speed(
    browser: Browser, server: RecordingServer, tmp_path: Path
) -> None:
    recording = tmp_path / "cut.ogg"
    recording.write_bytes(encode(sound_of_a_cut(), "OGG", "VORBIS"))
    browser.open(server.url, SIZES[-1])
    assert browser.part("record").get_attribute("capture") is not None
    assert browser.broken_rules() == []
    for name, value in (*CUT.items(), ("depth_mm", 1)):
        browser.part(name).send_keys(str(value))
    browser.part("send").click()
    browser.see("error", "No recording yet")
    browser.part("choose").send_keys(str(recording))
    browser.part("send").send_keys("\n")
    browser.wait(lambda: browser.part("result").is_displayed())
    assert (browser.part("word").text, browser.part("figure").text) == ("CHATTER", "1370 Hz")
    for size in SIZES:
        for scheme in ("light", "dark"):
            browser.prefer(scheme)
            browser.resize(size)
            assert browser.ask("document.documentElement.scrollWidth") <= size[0]
            assert browser.part("word").rect["height"] >= 40
            assert browser.broken_rules() == [], (size, scheme)
    best = browser.driver.find_element("css selector", "#speeds button")
    best.send_keys("\n")
    shown = "".join(best.text.partition(" rpm")[0].split())
    assert browser.part("speed_rpm").get_attribute("value") == shown
    assert browser.requested() == {server.origin}


def test_depths_of_a_machine_in_inches_are_entered_in_inches(browser: Browser, tmp_path: Path) -> None:
    toml = make_machine_folder(tmp_path / "mill", "surrogate_machine.toml")
    toml.write_text(toml.read_text("utf-8").replace("[machine]", '[machine]\nunits = "inch"', 1), "utf-8")
    with DashboardServer(tmp_path) as server:
        browser.open(f"{server.origin}/phone/#token={server.token}", SIZES[0])
        browser.part("depth_mm").send_keys("50.8")
        browser.wait(lambda: browser.part("machine").is_displayed())
        browser.part("machine").send_keys("mill")
        browser.see("unit", "in")
        browser.part("program").send_keys("A")
        depth = browser.part("depth_mm")
        browser.wait(lambda: depth.get_attribute("value") == "0.0984")
        browser.part("machine").send_keys("\ue013" * 2)
        browser.see("unit", "mm")
        assert float(depth.get_attribute("value") or 0) == pytest.approx(2.5, abs=0.003)
