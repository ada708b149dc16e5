"""Check the sample rate of a DAQ during a tap test."""

from acquisition import DataError, Device, Remark
from acquisition.errors import join_sentences
from acquisition.sensors.stream_rate import RECENT_TIME, StreamRate
from lobewatch.machine.daq_rates import replace_stored_rate
from lobewatch.measurement.recording_questions import RATE_NOT_VERIFIED
from lobewatch.tap.kept_rate import agrees_with, write_rate
from lobewatch.tap.state import Check
from lobewatch.tap.tap_in_progress import TapInProgress


def refuse_wrong_rate(tap: TapInProgress, device: Device, stream: StreamRate, *, is_whole: bool) -> None:
    """Raise DataError if the rate of a stream is off the rate in use. The hits stay in the spool.

    The measured rate replaces that in daq.json, so that the next test does not use the old one. is_whole: all hits of
    the test came from this stream, so that its rate is theirs.
    """
    found = stream.find_deviation()
    if found is None:
        return
    replace_stored_rate(tap.folder, device, found)
    if tap.hits:
        write_rate(tap.folder.spool / tap.id, found if is_whole and _is_constant(stream) else None)
    percent = 100 * (stream.sample_rate / found.rate - 1)
    error = f"every frequency would be {abs(percent):.2g} % too {'high' if percent > 0 else 'low'}"
    rates = f"the DAQ sampled at {found.rate:.2f} ± {found.std:.2f} Hz in this test, not {stream.sample_rate:g} Hz"
    kept = "The test is not saved, but its hits are kept"
    cure = "Measure the sample rate again with acquisition.measure_rate, then repeat the command"
    raise DataError(join_sentences(f"{rates}, so {error}", kept, cure))


def rate_remarks(stream: StreamRate) -> tuple[Remark, ...]:
    """Return the remark on a stream that was too short or too uneven to verify its rate."""
    if stream.is_verified:
        return ()
    text = f"the sample rate of {stream.sample_rate:g} Hz could not be verified{_format_rate(stream)}"
    return (Remark(RATE_NOT_VERIFIED.code, "", text, "Close other programs, and take more hits in the next test"),)


def check_stream_rate(stream: StreamRate) -> Check:
    """Return the line of the self-check on the rate of a stream that was not refused."""
    remarks = rate_remarks(stream)
    rate = f"{stream.sample_rate:g} Hz{_format_rate(stream)}"
    return Check("sample rate", not remarks, join_sentences(*map(str, remarks)) or rate)


def _is_constant(stream: StreamRate) -> bool:
    """Return whether the whole stream and its newest part have one accurately known rate."""
    whole, recent = stream.measure(), stream.measure(RECENT_TIME)
    return whole is not None and whole.is_accurate and recent is not None and agrees_with(recent, whole.rate)


def _format_rate(stream: StreamRate) -> str:
    measured = stream.measure()
    return "" if measured is None else f" ({measured.rate:.6g} ± {measured.std:.2g} Hz in {measured.seconds:.2g} s)"
