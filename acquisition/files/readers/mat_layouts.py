"""Recognize known layouts of variables in MATLAB files.

Seen in public files: vectors by name (`Freq_domain`, `Hf_chan_2`, `Hf_coh_chan_2`, `Time_chan_1`), matrices of a logger
(`yspec`, `indata`, `freq`, `npts`, `tfun`), SignalCalc (`H1_2`, `C1_2`, `X1`, `ChanName`, `Unit`), SigLab (`SLm`),
structs of Test.Lab (`x_values`, `y_values`), and our own. An FRF is taken before signals over time: it is the average
of the hits, they are one of them. `Description.columns` can take them all the same.
"""

import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from datetime import datetime
from typing import Any

import numpy as np
from numpy.typing import NDArray

from acquisition.files.contents.column_headings import infer_role, split_heading
from acquisition.files.contents.contents import Contents, Signal, list_array_signals

_WINDOW_NAME = re.compile(r"(response_?)?window(_?type)?", re.IGNORECASE)
_WINDOW_LOUD_SHARE = 0.02
"""Share of the largest value above which a sample shows the window."""
_WINDOW_FIT_TOLERANCE = 0.02
"""Largest rms of the logarithms about a straight line of an exponential window."""


def find_window(variables: Mapping[str, Any]) -> str:
    """Find the window as `Contents.window`: stated by a variable, or seen in the signals before and behind it."""
    named = (text for name, text in variables.items() if _WINDOW_NAME.fullmatch(name) and isinstance(text, str))
    responses = (name[1:] for name in variables if re.fullmatch(r"W([2-9]|\d\d)", name))
    windows = [_infer_window(variables.get(f"X{number}"), variables[f"W{number}"]) for number in responses]
    return next(named, "") or next(filter(None, windows), "")


def _infer_window(before: Any, behind: Any) -> str:
    """Infer the window between two signals (n, 2) of time and value; empty if they are equal, or none."""
    if not _is_pairs(before) or not _is_pairs(behind):
        return ""
    if before.shape != behind.shape or not np.any(before[:, 1]) or np.array_equal(before[:, 1], behind[:, 1]):
        return ""
    time, raw, windowed = np.real(before[:, 0]), np.real(before[:, 1]), np.real(behind[:, 1])
    loud = np.abs(raw) > _WINDOW_LOUD_SHARE * np.max(np.abs(raw))
    ratio = windowed[loud] / raw[loud]
    if ratio.size < 3 or np.any(ratio <= 0):
        return "of unknown form"
    time, level = time[loud], np.log(ratio)
    slope, start = np.polyfit(time, level, 1)
    if np.std(level - slope * time - start) > _WINDOW_FIT_TOLERANCE or slope > 0:
        return "of unknown form"
    return "" if -slope * np.ptp(time) < _WINDOW_FIT_TOLERANCE else f"exponential {-1 / slope:.4g} s"


def read_siglab(v: Mapping[str, Any]) -> Contents | None:
    """Read SigLab (.vna, DSP Technology): FRFs in volts over volts, returned in the units of their channels.

    `SLm` holds the frequencies (fdxvec), a cell for each reference and response (xcmeas) and the channels (scmeas) with
    units for each volt (euscale_fac). Public files show that these are not yet in its transfer functions (xfer): an
    accelerometer and a laser at one point agree with them, 0.9 to 1.1 in five of seven (docs/formats.md). None for
    other programs.
    """
    measured = v.get("SLm")
    if not isinstance(measured, Mapping) or not {"fdxvec", "xcmeas", "scmeas"} <= measured.keys():
        return None
    signals = tuple(_make_siglab_signals(measured))
    return Contents(signals, averages=int(measured.get("navg", 0)) or None) if len(signals) > 1 else None


def _make_siglab_signals(measured: Mapping[str, Any]) -> Iterator[Signal]:
    frequency = measured["fdxvec"]
    yield Signal("frequency", frequency, "frequency", "Hz")
    for reference, row in zip(measured["scmeas"], measured["xcmeas"], strict=False):
        for response, cell in zip(measured["scmeas"], row, strict=False):
            if np.shape(cell["xfer"]) == frequency.shape:
                (volts, below), (over, above) = _get_siglab_scale(reference), _get_siglab_scale(response)
                label = f"{response['label']} over {reference['label']}"
                yield Signal(label, cell["xfer"] * (over / volts), "frf", f"{above}/{below}")
            if np.shape(cell["coh"]) == frequency.shape:
                yield Signal("coherence", cell["coh"], "coherence")


def _get_siglab_scale(channel: Mapping[str, Any]) -> tuple[float, str]:
    """Return the units per volt, and the unit, of a channel."""
    return (float(channel["euscale_fac"]), f"({channel['eu_string']})") if channel["eu_on_off"] else (1.0, "V")


_FREQUENCY_NAME = re.compile(r"(f|freq\w*|.*_freq\w*|frequenc\w*|hz)", re.IGNORECASE)
_COHERENCE_NAME = re.compile(r".*(coh|gamma)", re.IGNORECASE)
_SPECTRUM_NAME = re.compile(r".*(cross|auto|psd|spec)", re.IGNORECASE)
_RATE_NAME = re.compile(r"(fs|samp\w*rate|.*sample_?rate|sampling_?(rate|frequency))", re.IGNORECASE)
_TIME_NAME = re.compile(r"(t|time|time_domain|tim)", re.IGNORECASE)


def recognize_layout(variables: Mapping[str, Any]) -> Contents | None:
    """Return the contents of variables in a known layout, else None."""
    programs = (_read_lobewatch, _read_signal_calc, read_siglab, _read_test_lab, _read_logger)
    layouts = (layout(variables) for layout in (*programs, _read_vectors, _read_time_vectors))
    contents = next(filter(None, layouts), None)
    return None if contents is None else replace(contents, window=find_window(variables))


def _read_lobewatch(v: Mapping[str, Any]) -> Contents | None:
    """Read variables as `encode_mat_frf` and `encode_mat_hits` write them."""
    if not isinstance(v.get("written_by"), str) or not v["written_by"].startswith("lobewatch"):
        return None
    texts = {name: v[name] if isinstance(v.get(name), str) else "" for name in ("recorded", "direction", "tool")}
    created = datetime.fromisoformat(texts["recorded"]) if texts["recorded"] else None
    labelled = Contents((), created=created, direction=texts["direction"], tool=texts["tool"])
    if "frf" in v:
        signals = [Signal("frequency", v["frequency"], "frequency", "Hz"), Signal("frf", v["frf"], "frf", v["unit"])]
        signals += [Signal("coherence", v["coherence"], "coherence")] if "coherence" in v else []
        return replace(labelled, signals=tuple(signals), averages=int(v["averages"]))
    rate, signals = float(v["sample_rate"]), list[Signal]()
    hits = zip(np.atleast_2d(v["force"]), np.atleast_2d(v["acceleration"]), strict=True)
    for record, (force, acceleration) in enumerate(hits):
        signals.append(Signal("force", force, "force", "N", rate=rate, record=record))
        signals.append(Signal("acceleration", acceleration, "response", "m/s^2", rate=rate, record=record))
    return replace(labelled, signals=tuple(signals))


def _read_signal_calc(v: Mapping[str, Any]) -> Contents | None:
    """Read SignalCalc: the abscissa is the first column, channel 1 is the hammer.

    Next to its FRFs are the signals of the last hit, before the window, for `Description.columns`; without FRFs they
    are that hit.
    """
    units, names = _list_texts(v.get("Unit")), _list_texts(v.get("ChanName"))
    frfs = [(name, match[1]) for name in v if (match := re.fullmatch(r"H1_(\d+)", name)) and _is_pairs(v[name])]
    hit = [(name, match[1]) for name in v if (match := re.fullmatch(r"X(\d+)", name)) and _is_pairs(v[name])]
    over_time = list(_make_signal_calc_hit(v, hit, units))
    if not frfs:
        return Contents((over_time[0], *over_time[1::2])) if len(hit) > 1 else None
    signals = [Signal("frequency", np.real(v[frfs[0][0]][:, 0]), "frequency", "Hz")]
    for name, channel in frfs:
        label = f"{name} {_get_channel_text(names, channel)}".strip()
        over, under = _get_channel_text(units, channel), _get_channel_text(units, "1")
        signals.append(Signal(label, v[name][:, 1], "frf", f"({over})/({under})" if over and under else ""))
        coherence = v.get(f"C1_{channel}")
        if coherence is not None and _is_pairs(coherence):
            signals.append(Signal(f"C1_{channel}", np.real(coherence[:, 1]), "coherence"))
    processing = " ".join(_list_texts(v.get("DP_Info")))
    averages = re.search(r"(?:averages|num.?avg|navg)\D{0,4}(\d+)", processing, re.IGNORECASE)
    signals += [replace(signal, role="", record=1) for signal in over_time]
    return Contents(tuple(signals), averages=int(averages[1]) if averages else None)


def _make_signal_calc_hit(
    v: Mapping[str, Any], hit: Sequence[tuple[str, str]], units: Sequence[str]
) -> Iterator[Signal]:
    """Yield time and values of each channel of a hit."""
    for name, channel in hit:
        time, values, unit = np.real(v[name][:, 0]), np.real(v[name][:, 1]), _get_channel_text(units, channel)
        yield Signal(f"{name}:1", time, "time", "s", is_before_window=True)
        yield Signal(f"{name}:2", values, "force" if channel == "1" else "response", unit, is_before_window=True)


def _is_pairs(value: Any) -> bool:
    return isinstance(value, np.ndarray) and value.ndim == 2 and value.shape[1] == 2


def _list_texts(value: Any) -> list[str]:
    if isinstance(value, str):
        return [value.strip()]
    return [str(text).strip() for text in value] if isinstance(value, (list, tuple, np.ndarray)) else []


def _get_channel_text(texts: Sequence[str], channel: str) -> str:
    return texts[int(channel) - 1] if int(channel) <= len(texts) else ""


def _read_test_lab(v: Mapping[str, Any]) -> Contents | None:
    """Read structs with `x_values` (start_value, increment) and `y_values` (values, quantity with a label)."""
    signals = list[Signal]()
    for name, value in v.items():
        for struct in value if isinstance(value, list) else [value]:
            if isinstance(struct, Mapping) and {"x_values", "y_values"} <= struct.keys():
                signals += _split_struct(name, struct["x_values"], struct["y_values"], len(signals))
    return Contents(tuple(signals)) if signals else None


def _split_struct(name: str, x: Mapping[str, Any], y: Mapping[str, Any], record: int) -> Iterator[Signal]:
    values = np.asarray(y["values"])
    columns = values.reshape(values.shape[0], -1).T
    unit = str((y.get("quantity") or {}).get("label", ""))
    step, start = float(x["increment"]), float(x.get("start_value", 0.0))
    is_frf = np.iscomplexobj(values)
    if is_frf:
        yield Signal("frequency", start + step * np.arange(columns.shape[1]), "frequency", "Hz", record=record)
    for i, column in enumerate(columns, 1):
        label = name if len(columns) == 1 else f"{name}:{i}"
        if is_frf:
            yield Signal(label, column, "frf", unit, record=record)
        else:
            yield Signal(label, column, infer_role(name, unit), unit, rate=1 / step)


def _read_logger(v: Mapping[str, Any]) -> Contents | None:
    """Read a logger: `freq` is the sample rate, `npts` the length of the record that `yspec` was made from."""
    if "freq" not in v or np.ndim(v["freq"]) or not ({"yspec", "indata"} & v.keys()):
        return None
    rate = float(v["freq"])
    if "yspec" in v and "npts" in v and np.iscomplexobj(v["yspec"]):
        columns = np.atleast_2d(v["yspec"].T)
        signals = [Signal("frequency", np.arange(columns.shape[1]) * rate / float(v["npts"]), "frequency", "Hz")]
        signals += [Signal(f"yspec:{i}", column, "frf") for i, column in enumerate(columns, 1)]
        if v.get("tfun", 0) and len(columns) == 2:
            signals[2] = replace(signals[2], values=columns[1].real, role="coherence")
        return Contents(tuple(signals))
    columns = np.atleast_2d(v["indata"].T)
    return Contents(tuple(Signal(f"indata:{i}", column, rate=rate) for i, column in enumerate(columns, 1)))


def _read_vectors(v: Mapping[str, Any]) -> Contents | None:
    """Read complex vectors and matrices of the length of a frequency, and their coherence.

    The time signals keep their names without a role, so that `Description.columns` can have them.
    """
    arrays = {name: value for name, value in v.items() if isinstance(value, np.ndarray) and value.dtype.kind in "fiuc"}
    for name, axis in arrays.items():
        if _FREQUENCY_NAME.fullmatch(name) and _is_rising(axis):
            parallel = _list_vectors_of_length(arrays, axis.size)
            complex_ones = (signal for signal in parallel if np.iscomplexobj(signal.values))
            frfs = [signal for signal in complex_ones if not _SPECTRUM_NAME.match(signal.name)]
            if frfs:
                return Contents(tuple(_make_vector_signals(arrays, name, frfs)))
    return None


def _make_vector_signals(
    arrays: Mapping[str, NDArray[Any]], frequency: str, frfs: Sequence[Signal]
) -> Iterator[Signal]:
    yield Signal(frequency, arrays[frequency], "frequency", split_heading(frequency)[1])
    yield from (replace(signal, role="frf") for signal in frfs)
    n = arrays[frequency].size
    taken = {frequency, *(signal.name for signal in frfs)}
    for signal in _list_vectors_of_length(arrays, n):
        if _COHERENCE_NAME.match(signal.name) and not np.iscomplexobj(signal.values):
            taken.add(signal.name)
            yield replace(signal, role="coherence")
    rest = ((name, values) for name, values in arrays.items() if values.ndim == 1 and name not in taken)
    yield from (Signal(name, values, record=1) for name, values in rest)


def _read_time_vectors(v: Mapping[str, Any]) -> Contents | None:
    """Read a time, or a sample rate, and vectors or a matrix of the same length, with roles by their names.

    Other variables have no role, so that `Description.columns` can have them. An FRF is taken before signals without a
    role.
    """
    arrays = {name: value for name, value in v.items() if isinstance(value, np.ndarray) and value.dtype.kind in "fiu"}
    rates = (v[name] for name in v if _RATE_NAME.fullmatch(name) and isinstance(v[name], (int, float, np.number)))
    rate = next((float(value) for value in rates if value > 0), None)
    axis = next((name for name in arrays if _TIME_NAME.fullmatch(name) and _has_equal_length(name, arrays)), None)
    if rate is None and axis is None:
        return None
    n = arrays[axis].size if axis else max((max(value.shape) for value in arrays.values()), default=0)
    signals = [Signal(axis, arrays[axis], "time")] if axis else []
    parallel = (signal for signal in _list_vectors_of_length(arrays, n) if signal.name != axis)
    signals += [replace(signal, role=infer_role(signal.name, ""), rate=rate) for signal in parallel]
    others = {name: value for name, value in v.items() if name not in arrays or n not in arrays[name].shape}
    unassigned = list(list_array_signals(others))
    has_frf = any(signal.role == "frf" for signal in unassigned)
    if not signals or (has_frf and not any(signal.role in ("force", "response") for signal in signals)):
        return None
    return Contents((*signals, *(replace(signal, role="") for signal in unassigned)))


def _has_equal_length(name: str, arrays: Mapping[str, NDArray[Any]]) -> bool:
    """Return whether it is a vector as long as others: an axis, though its values may be none."""
    axis = arrays[name]
    return axis.ndim == 1 and any(axis.size in value.shape for other, value in arrays.items() if other != name)


def _list_vectors_of_length(arrays: Mapping[str, NDArray[Any]], n: int) -> Iterator[Signal]:
    """Yield vectors of a length, and the columns of real arrays and of complex matrices as name:1, name:2, ..."""
    for name, values in arrays.items():
        if values.shape == (n,):
            yield Signal(name, values)
        elif n in values.shape and (values.ndim == 2 or not np.iscomplexobj(values)):
            columns = np.moveaxis(values, values.shape.index(n), -1).reshape(-1, n)
            yield from (Signal(f"{name}:{i}", column, array=values) for i, column in enumerate(columns, 1))


def _is_rising(axis: NDArray[Any]) -> bool:
    return axis.ndim == 1 and axis.size > 1 and not np.iscomplexobj(axis) and bool(np.all(np.diff(axis) > 0))
