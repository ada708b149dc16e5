"""Show serial ports with their devices, sensors with checks, and findings on the computer."""

from collections import Counter
from collections.abc import Iterator, Sequence

from rich.markup import escape

from acquisition import STANDARD_GRAVITY, Channel, PortInfo, PortScan, ScannedPort, explain_no_ports
from dsm import format_with_error
from lobewatch.measurement.chain_check import ChainCheck, find_weakest_check
from lobewatch.sensors.computer_check import Finding
from lobewatch.sensors.sensor_checks import MassCheck, SensorList, SkewCheck
from lobewatch.show.terminal.output import JsonObject, Texts, count_noun, new_table, pick

NO_ANSWER_TEXTS = (
    "No DAQ answers. Plug in the DAQ, wait a few seconds, then try again.",
    "A DATAQ device must blink yellow (CDC mode).",
)


def ports_texts(scan: PortScan) -> Texts:
    """Return a table of the ports, their problems, and the next step."""
    remarks = [*map(str, scan.remarks)]
    if not scan.ports:
        return [explain_no_ports(), *remarks]
    headings = "<port", "<VID:PID", "<serial number", "<description", "<answer"
    rows = (
        map(escape, (port.device, _usb_id(port), port.serial_number, port.description, _answer_text(scanned)))
        for scanned in scan.ports
        for port in [scanned.port]
    )
    problems = [scanned.problem for scanned in scan.ports if scanned.problem]
    return [new_table(*headings, rows=rows), *problems, *remarks, *_ports_summary(scan.ports)]


def _usb_id(port: PortInfo) -> str:
    return "" if port.vendor is None else f"{port.vendor:04x}:{port.product or 0:04x}"


def ports_json(scan: PortScan) -> JsonObject:
    """Return every port with its device, and the problems of drivers."""
    return {"ports": list(map(_port_json, scan.ports)), "remarks": scan.remarks}


def _port_json(scanned: ScannedPort) -> JsonObject:
    port, answer = scanned.port, scanned.answer
    identified = answer and {
        "driver": answer.driver,
        **pick(answer.identity, "model", "serial", "firmware"),
        "tried_on_hardware": answer.is_hardware_tested,
    }
    named = {"device": port.device, "usb": _usb_id(port), "serial_number": port.serial_number}
    return named | {"description": port.description, "answer": identified, "problem": scanned.problem or None}


def _answer_text(scanned: ScannedPort) -> str:
    answer = scanned.answer
    if answer is None:
        return scanned.text
    serial, firmware = answer.identity.serial, answer.identity.firmware
    words = [f"{answer.driver}: {answer.identity.model}", serial and f"serial number {serial}"]
    words += [firmware and f"firmware {firmware}", "" if answer.is_hardware_tested else "driver not tested on hardware"]
    return ", ".join(filter(None, words))


def _ports_summary(ports: tuple[ScannedPort, ...]) -> Sequence[str]:
    """Return how many devices answer, and the next step."""
    answering = [(listed.port.device, listed.answer.driver) for listed in ports if listed.answer]
    if not answering:
        return NO_ANSWER_TEXTS
    port, driver = answering[0]
    following = f'write driver = "{driver}" in [daq] of machine.toml, then lobewatch tap MACHINE --port {port}'
    return f"{len(answering)} of {len(ports)} ports answer", f"Next: {following}"


def sensors_json(sensors: SensorList) -> JsonObject:
    """Return the device, its channels and its sample rate."""
    measured = sensors.measured_rate
    return {
        **pick(sensors.identity, "model", "serial"),
        "channels": list(map(_channel_json, sensors.channels)),
        "sample_rate_hz": sensors.nominal_rate,
        "measured_rate_hz": measured and measured.rate,
        "measured_rate_hz_std": measured and measured.std,
        "remarks": sensors.remarks,
        "errors": sensors.errors,
    }


def _channel_json(channel: Channel) -> JsonObject:
    return {
        "quantity": channel.quantity,
        "direction": channel.direction,
        "sensitivity_v_per_si": channel.sensitivity,
        "full_scale_v": channel.full_scale,
        "full_scale_si": channel.full_scale / abs(channel.sensitivity),
        **pick(channel, "adc_bits", "serial_number", "calibration_date"),
        "skew_us": channel.skew * 1e6,
    }


def mass_check_json(check: MassCheck) -> JsonObject:
    """Return the ratio F/(m a) of a hung mass, and the sensitivities that follow from it."""
    result = check.calibration
    return {
        "mass_kg": result.mass,
        "ratio": result.ratio,
        "ratio_std": result.ratio_std,
        "phase_deg": result.phase,
        "inverted": result.inverted,
        "flatness": result.flatness,
        "band_hz": result.band,
        "hits": result.n_hits,
        "agrees": result.agrees,
        "force_sensitivity_v_per_n": result.force_sensitivity,
        "acceleration_sensitivity_v_per_m_s2": result.acceleration_sensitivity,
        "remarks": result.remarks,
        "journal": check.entry and check.entry.id,
        "passed": check.entry and check.entry.passed,
    }


def skew_check_json(check: SkewCheck) -> JsonObject:
    """Return the skew between the channels and its standard error."""
    skew = check.measured
    microseconds = {"skew_us": skew.skew * 1e6, "skew_us_std": skew.std * 1e6}
    return microseconds | {"skew_samples": skew.skew * check.sample_rate, "coherent_share": skew.coherent_share}


def sensors_texts(sensors: SensorList) -> Texts:
    """Return the device in words, a table of its channels, its sample rate, and warnings."""
    measured = sensors.measured_rate
    rate = "not measured" if measured is None else f"measured {format_with_error(measured.rate, measured.std)} Hz"
    rate += " (measured rate used)" if sensors.replaces_nominal else ""
    return [
        f"{sensors.identity.model}, serial number {sensors.identity.serial or 'unknown'}",
        new_table(*CHANNEL_HEADINGS, rows=(_channel_cells(i, channel) for i, channel in enumerate(sensors.channels))),
        f"sample rate: nominal {sensors.nominal_rate:g} Hz, {rate}",
        *(f"{'error' if remark in sensors.errors else 'warning'}: {remark}" for remark in sensors.remarks),
    ]


CHANNEL_HEADINGS = (
    "channel",
    "<quantity",
    "sensitivity",
    "range",
    "input",
    "bits",
    "skew\n(us)",
    "~serial",
    "<calibrated",
)


def _channel_cells(number: int, channel: Channel) -> list[str]:
    unit, si = ("N", 1.0) if channel.quantity == "force" else ("g", STANDARD_GRAVITY)
    sensitivity = f"{channel.sensitivity * 1e3 * si:.4g} mV/{unit}"
    reach = f"±{channel.full_scale / abs(channel.sensitivity) / si:.4g} {unit}"
    digits = f"±{channel.full_scale:g} V", str(channel.adc_bits), f"{channel.skew * 1e6:.4g}"
    sensor = escape(channel.serial_number or "-"), channel.calibration_date or "-"
    return [str(number), channel.name, sensitivity, reach, *digits, *sensor]


def mass_check_texts(check: MassCheck) -> list[str]:
    """Return the result of the mass check, and the change to make."""
    ratio = check.calibration.ratio
    if check.calibration.sizes_agree:
        return [str(check.calibration), *_journal_lines(check)]
    force, acceleration, place = "sensitivity_mv_per_n", "sensitivity_mv_per_g", "[[daq.channel]] of machine.toml"
    if check.place is not None:
        force, acceleration = (
            f"{check.place.sensitivity} of the force channel",
            f"{check.place.sensitivity} of the acceleration channel",
        )
        place = check.place.place
    change = f"In {place}, multiply {force} by {ratio:.4f}, or divide {acceleration} by {ratio:.4f}"
    return [str(check.calibration), change, *_journal_lines(check)]


def _journal_lines(check: MassCheck) -> list[str]:
    """Return what the check means for tap tests."""
    if check.entry is None:
        return ["Not stored, because the result is no measure of the sensitivities. Repeat the check."]
    counts = "counts for all tap tests with this DAQ and these sensitivities"
    if not check.entry.passed:
        counts = "tap tests with this DAQ and these sensitivities since the last good check do not count as checked"
    return [f"Stored as {check.entry.id}: {counts}"]


def skew_check_texts(check: SkewCheck) -> list[str]:
    """Return the skew, and the line to enter."""
    skew, channel = check.measured, check.channel
    entry = f"skew_us = {skew.skew * 1e6:.3f} in the [[daq.channel]] of channel 1 in machine.toml"
    if check.place is not None:
        entry = f"{check.place.skew} = {skew.skew:.3e} in {check.place.place}"
    return [
        f"channel 1 ({channel.quantity}) is sampled {format_with_error(skew.skew, skew.std, 1e-6)} us "
        f"({skew.skew * check.sample_rate:.4f} samples) after channel 0 (entered so far: {channel.skew * 1e6:.3f} us)",
        f"Enter {entry}, and 0 for channel 0",
    ]


def sensor_rows(channels: Sequence[Channel], checks: Sequence[ChainCheck]) -> Iterator[tuple[str, str]]:
    """Yield a row of the report for each sensor of a tap test, and one on the check of both."""
    for channel in channels:
        name, unit = ("hammer", "N") if channel.quantity == "force" else ("accelerometer", "(m/s²)")
        number = f"serial number {channel.serial_number or 'unknown'}"
        calibrated = f"calibrated {channel.calibration_date}" if channel.calibration_date else "calibration unknown"
        yield name, f"{number}, {1e3 * channel.sensitivity:.4g} mV/{unit}, {calibrated}"
    check = find_weakest_check(checks)
    if check is not None and check.is_recorded:
        yield "sensor chain", check.text


def findings_json(findings: Sequence[Finding]) -> JsonObject:
    """Return all findings on the computer, and how many prevent a tap test."""
    states = Counter(finding.state for finding in findings)
    return {"findings": [finding._asdict() for finding in findings], "hinder": states["hinders"]}


def findings_texts(findings: Sequence[Finding]) -> Texts:
    """Return a table of the findings with their remedies, and a count."""
    marks = {"fine": "✓", "note": "·", "hinders": "✗"}
    rows = ((marks[item.state], *map(escape, (item.subject, item.text, item.cure))) for item in findings)
    table = new_table("<", "<item", "~finding", "~remedy", rows=rows)
    count = Counter(finding.state for finding in findings)
    hinder, notes = count["hinders"], count["note"]
    end = f"{hinder} of {len(findings)} findings prevent a tap test" if hinder else "No finding prevents a tap test"
    return [table, f"{end} ({count_noun(notes, 'note')})" if notes else end]
