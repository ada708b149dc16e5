"""Parts of a cut and ripple: synthetic combs whose loudness, speed or chatter changes in time."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from lobewatch.cuts.chatter_detection import earlier_air
from lobewatch.cuts.chatter_detection.cut_evaluation import CutEvaluation, CutRecording, evaluate_recording
from lobewatch.cuts.chatter_detection.cut_windows import HeardWindow, join_windows
from lobewatch.cuts.chatter_detection.load_ripple import Ripple, compute_evenness, find_ripple_peaks, remove_slow_comb
from lobewatch.cuts.chatter_detection.peak_classification import (
    ChatterPeaks,
    classify_peaks,
    find_other_teeth,
    has_other_spacing,
)
from lobewatch.cuts.chatter_detection.spectrum import SpectralPeaks, compute_spectrum, find_separate_peaks
from lobewatch.cuts.chatter_detection.tooth_passing_comb import SpindleSpeed
from lobewatch.cuts.chatter_detection.window_evaluation import compare_with_stable, with_usual_speed
from lobewatch.cuts.chatter_detection.without_air import evaluate_without_air

Floats = NDArray[np.float64]
RATE, TURN, TEETH = 6400.0, 8000 / 60, 4
AIR = 1.0


def recording(seconds: float, change: Any = None, ahead: Any = None, add: Any = None) -> Floats:
    """Comb of four teeth with run-out, between a second of air each.

    change: loudness at times in the cut; ahead: time by which the spindle is ahead (s); add: signal in the cut.
    """
    random, time = np.random.default_rng(0), np.arange(round(seconds * RATE)) / RATE
    turned = time + (0.0 if ahead is None else ahead(time))
    cut = np.zeros(time.size)
    for order in range(1, 23):
        amplitude = 12.0 / (order / TEETH) ** 0.8 if order % TEETH == 0 else 1.0 / order
        cut += amplitude * np.cos(2 * np.pi * order * TURN * turned + random.uniform(0, 6))
    cut = cut * (1.0 if change is None else change(time)) + (0.0 if add is None else add(time))
    air = np.zeros(round(AIR * RATE))
    signal = np.concatenate([air, cut, air])
    return signal + 0.3 * random.normal(size=signal.size)


def listen(signal: Floats, teeth: int = TEETH, **options: Any) -> CutEvaluation:
    (heard,) = evaluate_recording(CutRecording(signal, RATE, teeth, 0.5, 8010.0, **options))
    return heard


def chatter(begin: float, end: float, frequency: float = 1760.0) -> Any:
    """Chatter with two side bands between two times (s)."""
    lines = ((frequency, 9.0), (frequency - TEETH * TURN, 3.0), (frequency + TEETH * TURN, 3.0))
    return lambda t: ((t > begin) & (t < end)) * sum(a * np.cos(2 * np.pi * f * t) for f, a in lines)


@pytest.fixture(scope="module")
def early() -> CutEvaluation:
    """Chatter from 1.1 to 4.1 s of the recording, in a cut from 1 to 7 s."""
    return listen(recording(6.0, add=chatter(0.1, 3.1)))


def test_the_worst_part_decides_and_its_times_are_known(early: CutEvaluation) -> None:
    assert early.verdict == "chatter"
    first, second = early.part_verdicts
    assert (first.verdict, second.verdict, second.hz) == ("chatter", "stable", None)
    assert first.hz == pytest.approx(1760.0, abs=1.0)
    assert (first.from_s, second.to_s) == pytest.approx((1.0, 7.0), abs=0.1)
    assert first.to_s == second.from_s == pytest.approx(4.1, abs=0.1)


@pytest.mark.parametrize("begin", [0.4, 1.9, 3.2])
def test_half_a_second_of_chatter_anywhere_is_reported(begin: float) -> None:
    heard = listen(recording(4.5, add=chatter(begin, begin + 0.5)))
    assert heard.verdict == "chatter"
    (part,) = [part for part in heard.part_verdicts if part.verdict == "chatter"]
    assert part.from_s <= AIR + begin + 0.2
    assert part.to_s >= AIR + begin + 0.3


def test_a_part_in_a_later_recording_is_shifted(early: CutEvaluation) -> None:
    part = early.part_verdicts[1].shift(-1.0)
    assert (part.from_s, part.to_s) == pytest.approx((3.1, 6.0), abs=0.1)


def swing(rate: float, depth: float, sharp: bool = False) -> Any:
    """Loudness that swings by `depth` (relative) at a rate (Hz), as a sine or a square wave."""

    def loudness(time: Floats) -> Floats:
        wave = np.sin(2 * np.pi * rate * time)
        return np.asarray(1 + depth * (np.sign(wave) if sharp else wave))

    return loudness


@pytest.mark.parametrize(("rate", "depth", "sharp"), [(8.3, 0.1, False), (4.0, 0.4, False), (24.0, 0.3, False),
                                                      (11.0, 0.4, True)])  # fmt: skip
def test_ripple_of_loudness_is_no_chatter_and_is_measured(rate: float, depth: float, sharp: bool) -> None:
    heard = listen(recording(2.2, swing(rate, depth, sharp)))
    assert (heard.verdict, heard.reason) == ("stable", "")
    assert heard.ripple is not None
    assert heard.ripple.frequency == pytest.approx(rate, abs=0.3)
    assert heard.ripple.loudness == pytest.approx(depth * (np.sqrt(2) if sharp else 1), rel=0.2)
    assert heard.ripple.speed == 0.0


def wave(rate: float, change: float) -> Any:
    """Time by which a spindle is ahead whose speed swings by `change` (relative) at a rate (Hz)."""
    return lambda t: change * np.sin(2 * np.pi * rate * t) / (2 * np.pi * rate)


@pytest.mark.parametrize(("rate", "change"), [(6.0, 2e-3), (15.0, 1.5e-3)])
def test_ripple_of_speed_is_no_chatter_and_is_measured(rate: float, change: float) -> None:
    heard = listen(recording(2.2, ahead=wave(rate, change)))
    assert (heard.verdict, heard.reason) == ("stable", "")
    assert heard.ripple is not None
    assert heard.ripple.frequency == pytest.approx(rate, abs=0.3)
    assert heard.ripple.speed == pytest.approx(change, rel=0.2)


@pytest.mark.parametrize("beside", [5.0, -12.0, 60.0])
def test_chatter_next_to_a_multiple_is_heard_through_ripple(beside: float) -> None:
    place = 3 * TEETH * TURN + beside
    heard = listen(recording(2.2, swing(9.0, 0.3), wave(9.0, 5e-4), chatter(0.0, 2.2, place)))
    assert heard.verdict == "chatter"
    assert heard.chatter is not None
    assert np.min(np.abs(heard.chatter.peaks.frequency - place)) < 1.5


def test_a_steady_cut_has_no_ripple() -> None:
    assert listen(recording(1.5)).ripple is None


def test_what_is_slower_than_100_hz_or_half_the_lowest_mode_is_no_chatter() -> None:
    def low(t: Floats) -> Floats:
        return sum(3.0 * np.cos(2 * np.pi * f * t) for f in (90.0, 90.0 - TURN / 2))  # type: ignore[return-value]

    assert listen(recording(1.5, add=low)).verdict == "stable"
    cut = recording(1.5, add=chatter(0.0, 1.5, 700.0))
    assert listen(cut).verdict == "chatter"
    assert listen(cut, lowest_mode=2700.0).verdict == "stable"


@pytest.mark.parametrize("stated", [2, 3, 5])
def test_a_number_of_flutes_that_the_comb_contradicts_is_named(stated: int) -> None:
    heard = listen(recording(1.5), stated)
    assert (heard.verdict, heard.reason, heard.comb_teeth) == ("cannot tell", "teeth-contradicted", 4)


@pytest.mark.parametrize(("orders", "teeth", "other"), [
    ((4, 8, 12), 4, 0), ((3, 6, 9), 4, 3), ((4, 8, 12), 2, 4), ((2, 4, 6, 8), 2, 0), ((10, 20), 4, 0),
])  # fmt: skip
def test_harmonics_of_other_teeth(orders: tuple[int, ...], teeth: int, other: int) -> None:
    lines = np.array(orders, dtype=float)
    comb = SpectralPeaks(100.0 * lines, np.ones(lines.size), np.full(lines.size, 1e6))
    assert find_other_teeth(comb, SpindleSpeed(100.0, 0.01, 1.0, 3, 0.0), teeth) == other


def test_side_bands_of_one_multiple_are_no_ripple() -> None:
    """8 Hz beside all three loud multiples with a tenth each, and 13 Hz beside one of them."""
    time = np.arange(12_800) / RATE
    multiples = np.array([400.0, 800.0, 1200.0])
    signal = sum(np.cos(2 * np.pi * f * time) + 0.1 * np.cos(2 * np.pi * (f + 8) * time) for f in multiples)
    signal = signal + 0.1 * np.cos(2 * np.pi * 813 * time)
    signal = signal + 1e-4 * np.random.default_rng(0).normal(size=time.size)
    left = SpectralPeaks(np.array([408.0, 808.0, 813.0, 1208.0]), np.full(4, 0.1), np.full(4, 1e6))
    comb = SpectralPeaks(multiples, np.ones(3), np.full(3, 1e6))
    spectrum = compute_spectrum(signal, RATE)
    assert not find_ripple_peaks(left, comb, spectrum, 100.0, None)[2]
    assert not find_ripple_peaks(left, comb, spectrum, 100.0, Ripple(8.0, 0.1, 0.0))[2]
    assert find_ripple_peaks(left, comb, spectrum, 100.0, Ripple(13.0, 0.1, 0.0))[2]


@pytest.mark.parametrize(("multiples", "turn", "is_slow"), [(12, 130.0, True), (12, 96.0, False), (6, 130.0, False)])
def test_multiples_of_a_load_that_steps_are_left_out(multiples: int, turn: float, is_slow: bool) -> None:
    """24 Hz; lines of which the turn is a multiple are chatter of several turns, and few may fit by chance."""
    others = np.array([713.0, 1291.0, 1733.0, 2206.0, 3127.0, 3997.0])
    frequency = np.concatenate([24.0 * np.arange(1, multiples + 1) ** 2, others])
    peaks = SpectralPeaks(frequency, np.ones(frequency.size), np.full(frequency.size, 1e6))
    left = remove_slow_comb(peaks, 0.5, turn)
    assert left.frequency.tolist() == (others if is_slow else frequency).tolist()


def find_ripple_beside(multiples: Floats, bands: dict[float, float]) -> list[bool]:
    """Find ripple among side bands; bands: their distances (Hz) and relative amplitudes, the same next to each."""
    time, amplitude = np.arange(12_800) / RATE, 1 / np.arange(1, multiples.size + 1)
    beside = (multiples[:, np.newaxis] + list(bands)).ravel()
    loud = (amplitude[:, np.newaxis] * list(bands.values())).ravel()
    lines = zip(np.append(multiples, beside), np.append(amplitude, loud), strict=True)
    signal = sum(a * np.cos(2 * np.pi * f * time) for f, a in lines)
    signal = np.asarray(signal) + 1e-4 * np.random.default_rng(0).normal(size=time.size)
    left = SpectralPeaks(beside, loud, np.full(beside.size, 1e6))
    comb = multiples > 100.0
    known = SpectralPeaks(multiples[comb], amplitude[comb], np.full(np.count_nonzero(comb), 1e6))
    return [bool(found) for found in find_ripple_peaks(left, known, compute_spectrum(signal, RATE), 100.0, None)]


def test_chatter_40_hz_from_all_multiples_is_no_ripple_unless_it_is_a_harmonic_of_one() -> None:
    """Ripple is slower than 30 Hz, so that its harmonics have a louder first one."""
    multiples: Floats = np.array([400.0, 800.0, 1200.0, 1600.0])
    assert not any(find_ripple_beside(multiples, {-40.0: 0.1, 40.0: 0.1}))
    assert all(find_ripple_beside(multiples, {-40.0: 0.03, -8.0: 0.15, 8.0: 0.15, 40.0: 0.03}))


def test_the_first_multiple_of_the_spindle_ripples_like_the_others() -> None:
    assert all(find_ripple_beside(100.0 * np.array([1.0, 4.0, 8.0, 12.0]), {-12.0: 0.1, 12.0: 0.1}))


@pytest.mark.parametrize(("lines", "is_load"), [((-1.5, 1.5), True), ((1.5,), False), ((-9.0, 9.0), False)])
def test_a_pair_next_to_a_multiple_that_a_corner_cancels_is_the_load(lines: tuple[float, ...], is_load: bool) -> None:
    time, multiple = np.arange(4 * 6400) / RATE, 1800.0
    signal = sum(np.cos(2 * np.pi * (multiple + beside) * time) for beside in lines) + np.cos(2 * np.pi * 400 * time)
    signal = signal + 1e-4 * np.random.default_rng(0).normal(size=time.size)
    left = SpectralPeaks(multiple + np.array(lines), np.ones(len(lines)), np.full(len(lines), 1e6))
    comb = SpectralPeaks(np.array([400.0]), np.ones(1), np.full(1, 1e6))
    found = find_ripple_peaks(left, comb, compute_spectrum(np.asarray(signal), RATE), 100.0, None)
    assert list(found) == [is_load] * len(lines)


def test_the_loudest_of_two_chatter_frequencies_is_told() -> None:
    """The lower one has more side bands, but next to none of the energy."""

    def two(t: Floats) -> Floats:
        lines = [(1760.0, 9.0), (1760.0 + TURN, 0.3), *((1100.0 + k * TEETH * TURN, 0.4) for k in (-1, 1, 2, 3))]
        return np.asarray(sum(a * np.cos(2 * np.pi * f * t) for f, a in [*lines, (1100.0, 2.0)]))

    heard = listen(recording(2.2, add=two))
    assert heard.verdict == "chatter"
    assert heard.chatter is not None
    assert heard.chatter.frequency == pytest.approx(1760.0, abs=0.5)


@pytest.mark.parametrize("amplitude", [0.4, 1.0])
def test_a_cut_that_chatters_loudly_at_its_entry_is_not_stable(amplitude: float) -> None:
    growing = chatter(0.0, 0.4)
    heard = listen(recording(6.0, add=lambda t: growing(t) * amplitude * np.exp(t / 0.08)))
    assert heard.verdict != "stable"


@pytest.mark.parametrize(("begin", "end"), [(0.0, 0.5), (5.5, 6.0)])
def test_half_a_second_of_chatter_at_either_end_of_a_cut_is_told(begin: float, end: float) -> None:
    heard = listen(recording(6.0, add=chatter(begin, end)))
    assert heard.verdict == "chatter"
    assert {part.verdict for part in heard.part_verdicts} >= {"chatter", "stable"}


def test_a_line_that_is_as_loud_in_the_stable_windows_makes_no_part_chatter() -> None:
    signal = recording(6.0, add=chatter(0.1, 6.0))
    whole = listen(signal)
    assert [part.verdict for part in whole.part_verdicts] == ["chatter"]
    windows = [
        whole._replace(parts=whole.parts._replace(cut=slice(round(at * RATE), round((at + 2) * RATE))))
        for at in (1.5, 2.5, 3.5)
    ]
    stable = [window._replace(verdict="stable", chatter=None) for window in windows[1:]]
    compared = compare_with_stable(np.atleast_2d(signal), RATE, [windows[0], *stable])
    assert [window.verdict for window in compared] == ["cannot tell", "stable", "stable"]
    assert compared[0].reason == "unexplained-tone"
    assert compared[0].tone == pytest.approx(1760.0, abs=1.0)
    louder = np.atleast_2d(recording(6.0, add=chatter(0.1, 2.5)))
    compared = compare_with_stable(louder, RATE, [windows[0], *stable])
    assert [window.verdict for window in compared] == ["chatter", "stable", "stable"]


def test_the_speed_of_a_cut_is_that_of_its_longest_windows(early: CutEvaluation) -> None:
    assert early.spindle_speed is not None
    windows = [
        early._replace(
            parts=early.parts._replace(cut=slice(0, size)), spindle_speed=early.spindle_speed._replace(frequency=turn)
        )
        for size, turn in ((4, 101.0), (1, 90.0), (4, 100.0), (1, 91.0), (4, 102.0))
    ]
    assert with_usual_speed(windows[1], windows).speed_rpm == 60 * 101.0


@pytest.mark.parametrize(("spacing", "differs"), [(200.0, False), (200.3, False), (198.9, True), (201.0, True)])
def test_side_bands_of_another_spacing_belong_to_another_speed(spacing: float, differs: bool) -> None:
    """Harmonics that a sensor without a filter folds back are one tooth passing of their own speed apart."""
    frequency = np.array([320.0, 320.0 + spacing, 320.0 + 2 * spacing], dtype=np.float64)
    peaks = SpectralPeaks(frequency, np.ones(3), np.full(3, 1e3))
    assert has_other_spacing(ChatterPeaks(320.0, 0.1, peaks), 200.0) == differs
    assert not has_other_spacing(ChatterPeaks(320.0, 0.1, peaks[np.array([0])]), 200.0)


def test_parts_between_overlapping_windows_with_chatter_end_after_they_begin() -> None:
    signal = np.atleast_2d(recording(6.0, add=chatter(0.0, 6.0)))
    seconds = ((1.0, 3.1, 1760.0), (2.0, 4.0, None), (2.8, 4.8, 1760.0), (5.0, 7.0, None))
    windows = [
        HeardWindow(slice(round(a * RATE), round(b * RATE)), "chatter" if hz else "cannot tell", hz, 9.0)
        for a, b, hz in seconds
    ]
    parts = join_windows(signal, windows, CutEvaluation("chatter", "").parts._replace(begin=1.0, end=7.0), RATE)
    assert [part.verdict for part in parts] == ["chatter", "chatter", "cannot tell"]
    assert all(part.from_s < part.to_s for part in parts)
    assert [part.to_s for part in parts[:-1]] == [part.from_s for part in parts[1:]]


@pytest.mark.parametrize(("begin", "verdict"), [(0.5, "chatter"), (9.0, "stable")])
def test_a_recording_of_nothing_but_a_cut_is_evaluated_in_all_its_parts(begin: float, verdict: str) -> None:
    cut = recording(6.0, add=chatter(begin, begin + 1.5))[round(AIR * RATE) : -round(AIR * RATE)]
    unknown = CutEvaluation("cannot tell", "no-cut")
    (heard,) = evaluate_without_air(CutRecording(cut, RATE, TEETH, 0.5, 8010.0), [unknown])
    assert heard.verdict == verdict
    assert heard.part_verdicts[-1].verdict == "stable"
    assert heard.part_verdicts[-1].to_s == pytest.approx(6.0)


@pytest.mark.parametrize("seconds", [0.5, 8.0])
def test_air_of_another_microphone_position_gets_the_noise_of_the_recording(
    monkeypatch: pytest.MonkeyPatch, seconds: float
) -> None:
    random, made = np.random.default_rng(0), list[CutRecording]()

    def keep(recording: CutRecording) -> list[CutEvaluation]:
        made.append(recording)
        return []

    monkeypatch.setattr(earlier_air, "evaluate_recording", keep)
    air, noise = random.normal(size=(1, round(seconds * RATE))), 5.0 * random.normal(size=round(2 * RATE))
    earlier_air.evaluate_with_air(CutRecording(noise, RATE, TEETH, 0.5, 8010.0), air, is_calibrated=False)
    assert np.std(made[0].signal[0, : air.shape[1]]) == pytest.approx(5.0, rel=0.1)


def evenness(envelope: NDArray[np.floating[Any]]) -> float:
    """Evenness of a line with an envelope, shape (n,), in a comb and a slow ripple that are far louder."""
    time = np.arange(envelope.size) / RATE
    line = envelope * np.cos(2 * np.pi * 1760 * time) + 50.0 * np.cos(2 * np.pi * 9 * TURN * time)
    signal = line + 20.0 * np.cos(2 * np.pi * 50.5 * time) + 1e-3 * np.random.default_rng(0).normal(size=time.size)
    return compute_evenness(signal, compute_spectrum(signal, RATE), np.zeros(0), TURN, 100.0)


def test_evenness_is_the_share_of_time_that_a_line_sounds_in() -> None:
    time = np.arange(round(2 * RATE)) / RATE
    assert evenness(np.ones(time.size)) == pytest.approx(1.0, abs=0.02)
    assert evenness(1.0 * (np.mod(time, 0.1) < 0.04)) == pytest.approx(0.5, abs=0.06)
    swing = 1 + 0.4 * np.sin(2 * np.pi * 12.5 * time)
    assert evenness(swing) == pytest.approx(np.mean(swing**2) ** 2 / np.mean(swing**4), abs=0.05)


def test_chatter_that_grows_is_even_and_a_mode_that_rings_after_each_rib_is_not() -> None:
    time = np.arange(round(2 * RATE)) / RATE
    growing: Floats = np.exp(time[: time.size // 4] / 0.06)
    assert evenness(growing) > 0.9
    assert evenness(np.asarray(np.exp(-np.mod(time, 0.1) / 0.008))) < 0.3


def test_a_sensor_without_a_filter_folds_multiples_back_that_are_no_chatter() -> None:
    """Multiple 52 of 50.01 Hz comes back at 2 x 1651 - 2600.5 = 701.5 Hz, louder than any other above 578 Hz."""
    rate, turn, time = 1651.0, 50.01, np.arange(3302) / 1651.0
    lines = ((4 * turn, 3.0), (8 * turn, 2.0), (12 * turn, 0.1), (52 * turn, 0.5), (653.3, 0.4))
    signal = sum(a * np.cos(2 * np.pi * f * time) for f, a in lines) + 1e-3 * np.random.default_rng(5).normal(size=3302)
    spectrum = compute_spectrum(signal, rate)
    quiet = spectrum._replace(power=0 * spectrum.power)
    speed = SpindleSpeed(turn, 1e-3, 1.0, 4, 0.0)
    found = classify_peaks(find_separate_peaks(spectrum), spectrum, quiet, speed, TEETH, 1e-4)
    assert found.folded.frequency == pytest.approx([701.48], abs=0.1)
    assert found.unexplained.frequency == pytest.approx([653.3], abs=0.1)
