"""Show serial ports and the devices that answer, their sensors with checks, and what was found of the computer."""

from collections import Counter
from collections.abc import Sequence

from rich.markup import escape

from acquisition import STANDARD_GRAVITY, Channel, PortInfo, PortScan, ScannedPort, explain_no_ports
from dsm import format_with_error
from lobewatch.sensors.computer_check import Finding
from lobewatch.sensors.sensor_checks import MassCheck, SensorList, SkewCheck
from lobewatch.show.terminal.output import JsonObject, Texts, json_fields, new_table

NO_ANSWER_TEXT = (
    "No DAQ answers. One that was just plugged in may need some seconds; a DATAQ device must blink yellow (CDC mode)."
)


def ports_texts(scan: PortScan) -> Texts:
    """Return a table of the ports, their problems, and the next step."""
    remarks = [f"{remark}." for remark in scan.remarks]
    if not scan.ports:
        return [explain_no_ports(), *remarks]
    headings = "<port", "<VID:PID", "<serial number", "<description", "<answer"
    rows = (
        map(escape, (port.device, _usb_id(port), port.serial_number, port.description, _answer_text(scanned)))
        for scanned in scan.ports
        for port in [scanned.port]
    )
    problems = [scanned.problem for scanned in scan.ports if scanned.problem]
    return [new_table(*headings, rows=rows), *problems, *remarks, _ports_summary(scan.ports)]


def _usb_id(port: PortInfo) -> str:
    return "" if port.vendor is None else f"{port.vendor:04x}:{port.product or 0:04x}"


ANSWER_FIELDS = json_fields("""
    driver model=identity.model serial=identity.serial firmware=identity.firmware tried_on_hardware=is_hardware_tested
""")
PORT_FIELDS = json_fields(
    "device=port.device usb=port serial_number=port.serial_number description=port.description answer problem",
    {"usb": _usb_id, "answer": ANSWER_FIELDS, "problem": lambda problem: problem or None},
)
ports_json = json_fields("ports remarks", {"ports": PORT_FIELDS})
"""Function that returns every port with the device that answers, and what is wrong with drivers."""


def _answer_text(scanned: ScannedPort) -> str:
    answer = scanned.answer
    if answer is None:
        return scanned.text
    serial, firmware = answer.identity.serial, answer.identity.firmware
    words = [f"{answer.driver}: {answer.identity.model}", serial and f"serial number {serial}"]
    words += [firmware and f"firmware {firmware}", "" if answer.is_hardware_tested else "not tried on hardware"]
    return ", ".join(filter(None, words))


def _ports_summary(ports: tuple[ScannedPort, ...]) -> str:
    """Return how many devices answer, and the next step."""
    answering = [(listed.port.device, listed.answer.driver) for listed in ports if listed.answer]
    if not answering:
        return NO_ANSWER_TEXT
    port, driver = answering[0]
    following = f'lobewatch tap MACHINE --port {port}, with driver = "{driver}" in [daq] of its machine.toml'
    return f"{len(answering)} of {len(ports)} answer; next: {following}"


CHANNEL_FIELDS = json_fields(
    """
    quantity direction sensitivity_v_per_si=sensitivity full_scale_v=full_scale full_scale_si=self adc_bits
    serial_number calibration_date skew_us=skew*1e6
    """,
    {"full_scale_si": lambda channel: channel.full_scale / abs(channel.sensitivity)},
)
sensors_json = json_fields(
    """
    model=identity.model serial=identity.serial channels sample_rate_hz=nominal_rate measured_rate_hz=measured_rate.rate
    measured_rate_hz_std=measured_rate.std remarks errors
    """,
    {"channels": CHANNEL_FIELDS},
)
"""Function that returns the device, its channels and its sample rate."""
mass_check_json = json_fields("""
    mass_kg=calibration.mass ratio=calibration.ratio ratio_std=calibration.ratio_std phase_deg=calibration.phase
    inverted=calibration.inverted flatness=calibration.flatness band_hz=calibration.band hits=calibration.n_hits
    agrees=calibration.agrees force_sensitivity_v_per_n=calibration.force_sensitivity
    acceleration_sensitivity_v_per_m_s2=calibration.acceleration_sensitivity remarks=calibration.remarks
""")
"""Function that returns the ratio F/(m a) of a hung mass, and the sensitivities that follow from it."""
skew_check_json = json_fields(
    """
    skew_us=measured.skew*1e6 skew_us_std=measured.std*1e6 skew_samples=self coherent_share=measured.coherent_share
    """,
    {"skew_samples": lambda check: check.measured.skew * check.sample_rate},
)
"""Function that returns the skew between the channels and its standard error."""


def sensors_texts(sensors: SensorList) -> Texts:
    """Return the device in words, a table of its channels, its sample rate, and warnings."""
    measured = sensors.measured_rate
    rate = "not measured" if measured is None else f"measured {format_with_error(measured.rate, measured.std)} Hz"
    rate += ", which is worked with" if sensors.replaces_nominal else ""
    return [
        f"{sensors.identity.model}, serial number {sensors.identity.serial or 'not known'}",
        new_table(*CHANNEL_HEADINGS, rows=(_channel_cells(i, channel) for i, channel in enumerate(sensors.channels))),
        f"rate: {sensors.nominal_rate:g} Hz, {rate}",
        *(f"{'error' if remark in sensors.errors else 'warning'}: {remark}" for remark in sensors.remarks),
    ]


CHANNEL_HEADINGS = "no", "<quantity", "sensitivity", "range", "input", "bits", "skew\n(us)", "~serial", "<calibrated"


def _channel_cells(number: int, channel: Channel) -> list[str]:
    unit, si = ("N", 1.0) if channel.quantity == "force" else ("g", STANDARD_GRAVITY)
    sensitivity = f"{channel.sensitivity * 1e3 * si:.4g} mV/{unit}"
    reach = f"±{channel.full_scale / abs(channel.sensitivity) / si:.4g} {unit}"
    digits = f"±{channel.full_scale:g} V", str(channel.adc_bits), f"{channel.skew * 1e6:.4g}"
    sensor = escape(channel.serial_number or "-"), channel.calibration_date or "-"
    return [str(number), channel.name, sensitivity, reach, *digits, *sensor]


def mass_check_texts(check: MassCheck) -> list[str]:
    """Return the result of the mass check, and what to change where."""
    ratio = check.calibration.ratio
    if check.calibration.sizes_agree:
        return [str(check.calibration)]
    force, acceleration, place = "sensitivity_mv_per_n", "sensitivity_mv_per_g", "[[daq.channel]] of machine.toml"
    if check.place is not None:
        force, acceleration = f"{check.place.sensitivity} of the force channel", "that of the acceleration channel"
        place = check.place.place
    change = f"To change in {place}: multiply {force} by {ratio:.4f}, or divide {acceleration} by {ratio:.4f}."
    return [str(check.calibration), change]


def skew_check_texts(check: SkewCheck) -> list[str]:
    """Return the skew, and where to enter it."""
    skew, channel = check.measured, check.channel
    entry = f"skew_us = {skew.skew * 1e6:.3f} in its [[daq.channel]] of machine.toml"
    if check.place is not None:
        entry = f"{check.place.skew} = {skew.skew:.3e} in {check.place.place}"
    return [
        f"channel 1 ({channel.quantity}) is sampled {format_with_error(skew.skew, skew.std, 1e-6)} us "
        f"({skew.skew * check.sample_rate:.4f} samples) after channel 0; entered is {channel.skew * 1e6:.3f} us",
        f"To enter: {entry}; 0 for channel 0",
    ]


def findings_json(findings: Sequence[Finding]) -> JsonObject:
    """Return all findings on the computer, and how many prevent a tap test."""
    return {"findings": findings, "hinder": Counter(finding.state for finding in findings)["hinders"]}


def findings_texts(findings: Sequence[Finding]) -> Texts:
    """Return a table of the findings with their remedies, and a count."""
    marks = {"fine": "✓", "note": "·", "hinders": "✗"}
    rows = ((marks[item.state], *map(escape, (item.subject, item.text, item.cure))) for item in findings)
    table = new_table("<", "<what", "~there is", "~what to do", rows=rows)
    count = Counter(finding.state for finding in findings)
    hinder, notes = count["hinders"], count["note"]
    end = f"{hinder} of {len(findings)} stand in the way of a tap test" if hinder else "Nothing stands in the way"
    return [table, f"{end}; {notes} worth knowing" if notes else end]
