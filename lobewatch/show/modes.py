"""Show the modes of a tap test or of a recorded file."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import asdict
from typing import Any

from rich.table import Table

from acquisition import Fact, Remark, merge_remarks
from dsm import format_rounded, format_with_error
from lobewatch.measurement import FileModes
from lobewatch.show.terminal.output import new_table
from modal import Mode, Trust, assess_trust, trust_rules

TRUST_ORDER = (Trust.TRUSTED, Trust.DOUBTFUL, Trust.REJECTED)
"""Order in which modes are shown."""
TRUST_SYMBOLS = {Trust.TRUSTED: "", Trust.DOUBTFUL: "!", Trust.REJECTED: "✗"}
"""Marks behind a mode."""
MIN_SHOWN_PHASE = 1.0
"""Phase of a modal constant worth a column (degrees)."""
MIN_SHOWN_CORRELATION = 0.5
"""Correlation of errors that a person should know."""
FOUND_AGAIN_NOTE = "again: how many of the other measurements have it within 0.5 %"
"""Line below a table with that column."""
ORIGIN_WORDS = {"file": "from the file", "option": "by option", "default": "nobody says, taken"}
"""Words for where a fact on a file is from."""
NON_FILE_ORIGINS = "option", "default"
"""Origins of facts that a file does not say itself."""


def mode_json(mode: Mode) -> dict[str, Any]:
    """One mode."""
    frequency, damping, stiffness = mode.standard_error
    by_fit = mode.fit_error
    return {
        "frequency_hz": mode.frequency,
        "frequency_hz_std": frequency,
        "frequency_hz_std_of_fit": by_fit[0],
        "damping_ratio": mode.damping_ratio,
        "damping_ratio_std": damping,
        "damping_ratio_std_of_fit": by_fit[1],
        "stiffness_n_per_m": mode.stiffness,
        "stiffness_n_per_m_std": stiffness,
        "stiffness_n_per_m_std_of_fit": by_fit[2],
        "interval_95": mode.interval(),
        "correlation": mode.correlation,
        "hits": mode.n_hits,
        "driving_point": mode.is_driving_point,
        "phase_deg": mode.phase_deg,
        "phase_deg_std": mode.phase_deg_std,
        "coherence": mode.coherence,
        "misfit": mode.misfit,
        "misfit_share": mode.misfit_share,
        "trust": assess_trust(mode),
        "found_again": mode.match_count,
        "half_power_damping_ratio": mode.half_power_damping,
        "remarks": [asdict(remark) for remark in mode.remarks],
        "method": mode.method,
    }


def sort_modes(modes: Iterable[Mode], *, rejected: bool = True) -> list[Mode]:
    """Trusted modes by rising frequency, then doubtful ones, then rejected ones where they are wanted, those that a
    person chose always."""
    kept = [mode for mode in modes if rejected or assess_trust(mode) is not Trust.REJECTED or _is_by_hand(mode)]
    return sorted(kept, key=lambda mode: (TRUST_ORDER.index(assess_trust(mode)), mode.frequency))


def _is_by_hand(mode: Mode) -> bool:
    return any(remark.code == "by-hand" for remark in mode.remarks)


def mode_table(modes: Sequence[Mode]) -> Table:
    """Modes, a line each, value ± standard error, the phase where there is any, how many other FRFs have it where some
    were looked at, and a mark where one is doubtful."""
    with_phase = any(abs(mode.phase_deg) > MIN_SHOWN_PHASE for mode in modes)
    with_others = any(mode.match_count for mode in modes)
    headings = [*(["phase (deg)"] if with_phase else []), *(["again"] if with_others else [])]
    rows = new_table("f_n (Hz)", "zeta (%)", "K (N/um)", *headings, "<")
    for mode in modes:
        values = (mode.frequency, mode.damping_ratio, mode.stiffness)
        cells = [
            "not known"
            if math.isnan(value)
            else format_with_error(value, std, scale, percent=scale == 1e6 and not with_phase)
            for value, std, scale in zip(values, mode.standard_error, (1.0, 0.01, 1e6), strict=True)
        ]
        again = "" if mode.match_count is None else "{} of {}".format(*mode.match_count)
        more = [*([_mode_phase_text(mode)] if with_phase else []), *([again] if with_others else [])]
        rows.add_row(*cells, *more, TRUST_SYMBOLS[assess_trust(mode)])
    return rows


def _mode_phase_text(mode: Mode) -> str:
    return format_with_error(mode.phase_deg, mode.phase_deg_std or None) if mode.phase_deg else "0"


def mode_notes(modes: Sequence[Mode]) -> list[str]:
    """Lines below a table of modes: where ± comes from, what is found again, and correlated errors."""
    hits = max((mode.n_hits for mode in modes), default=0)
    how = "jackknife" if all(mode.has_stiffness for mode in modes) else "by how each moves the fit"
    lines = [f"± is the standard error over the {hits} hits ({how}, {hits - 1} degrees of freedom)"] if hits else []
    lines += [FOUND_AGAIN_NOTE] if any(mode.match_count for mode in modes) else []
    for (i, j), names in (((0, 1), "f_n and zeta"), ((0, 2), "f_n and K"), ((1, 2), "zeta and K")):
        of = [(mode.correlation[i, j], mode.frequency) for mode in modes]
        high = [f"{value:+.2f} ({at:.0f} Hz)" for value, at in of if abs(value) > MIN_SHOWN_CORRELATION]
        if high:
            lines.append(f"correlation of the errors of {names}: {', '.join(high)}")
    return lines


def mode_remark_lines(modes: Sequence[Mode], remarks: Sequence[Remark]) -> list[str]:
    """Remarks on single modes and further ones, a line each; what several modes have in common is one."""
    return [str(remark) for remark in merge_remarks([*(remark for mode in modes for remark in mode.remarks), *remarks])]


def grouped_remark_lines(modes: Sequence[Mode], remarks: Sequence[Remark]) -> list[str]:
    """A line for each code: that of the first mode that has it, and which others have it, too."""
    by_code: dict[str, list[Remark]] = {}
    for remark in [*(remark for mode in modes for remark in mode.remarks), *remarks]:
        by_code.setdefault(remark.code, []).append(remark)
    return [line for same in by_code.values() for line in _grouped_line(merge_remarks(same))]


def _grouped_line(same: list[Remark]) -> list[str]:
    first, *alike = same
    about = ", ".join(remark.about for remark in alike)
    if alike and not about:
        return [str(remark) for remark in same]
    return [f"{first}{f' (the like of {about})' if about else ''}"]


def trust_summary(modes: Sequence[Mode], *, everything: bool) -> str:
    """How many modes are trusted, doubtful and rejected, in a line."""
    count = Counter(assess_trust(mode) for mode in modes)
    counts = ", ".join(f"{count[trust]} {trust}" for trust in TRUST_ORDER)
    looked = not count[Trust.DOUBTFUL] or any(mode.match_count for mode in modes)
    hints = [] if looked else ["--beside looks for them in other measurements"]
    hints = hints if everything or not modes else ["--all shows each, with every remark", *hints]
    return counts + (f" ({'; '.join(hints)})" if hints else "")


def trust_reasons(modes: Sequence[Mode]) -> list[str]:
    """Which modes have hammer and sensor apart, and which are doubtful and rejected by which rules, a line each."""
    elsewhere = [f"{mode.frequency:.0f} Hz" for mode in modes if not mode.is_driving_point]
    lines = [f"not a driving point: {', '.join(elsewhere)}"] if elsewhere else []
    for trust in TRUST_ORDER[1:]:
        texts = [
            f"{mode.frequency:.0f} Hz ({', '.join(code for code, _ in trust_rules(mode))})"
            for mode in modes
            if assess_trust(mode) is trust
        ]
        lines += [f"{TRUST_SYMBOLS[trust]} {trust}: {', '.join(texts)}"] if texts else []
    return lines


def peak_picking_table(picked: Sequence[Mode], fitted: Sequence[Mode]) -> Table:
    """Modes by peak picking, and how far each is from the fitted mode nearest to it."""
    rows = new_table("f_n (Hz)", "zeta (%)", "K (N/um)", "<against the fit")
    for mode in picked:
        near = min(fitted, key=lambda fit: abs(fit.frequency - mode.frequency), default=None)
        same = near is not None and abs(near.frequency - mode.frequency) < mode.damping_ratio * mode.frequency
        rows.add_row(
            f"{mode.frequency:.5g}",
            f"{100 * mode.damping_ratio:.5g}",
            format_rounded(mode.stiffness, scale=1e6, digits=5),
            _difference_text(mode, near) if same and near is not None else "not fitted",
        )
    return rows


def _difference_text(mode: Mode, fit: Mode) -> str:
    zeta, k = mode.damping_ratio / fit.damping_ratio - 1, mode.stiffness / fit.stiffness - 1
    return f"f_n {mode.frequency - fit.frequency:+.2g} Hz, zeta {100 * zeta:+.1f} %, K {100 * k:+.1f} %"


def file_modes_json(file_modes: FileModes) -> dict[str, Any]:
    """The modes of one file."""
    return {
        "file": str(file_modes.path),
        "n_averages": None if file_modes.frf is None else file_modes.frf.n_averages,
        "usable_band_hz": None if file_modes.frf is None else file_modes.frf.usable_band,
        "facts": [asdict(fact) for fact in file_modes.facts],
        "by_hand": asdict(file_modes.by_hand),
        "modes": [mode_json(mode) for mode in file_modes.fitted],
        "peak_picking": [mode_json(mode) for mode in file_modes.picked],
        "remarks": [asdict(remark) for remark in file_modes.remarks],
    }


def file_modes_texts(file_modes: FileModes, *, everything: bool = False) -> list[str | Table]:
    """The modes of one file for people; those that are rejected, and each single remark, where everything is wanted."""
    shown = sort_modes(file_modes.fitted, rejected=everything)
    remarks = mode_remark_lines if everything else grouped_remark_lines
    return [
        f"{file_modes.path.name}: {_frf_text(file_modes)}",
        *fact_lines(file_modes.facts, NON_FILE_ORIGINS),
        mode_table(shown),
        trust_summary(file_modes.fitted, everything=everything),
        *trust_reasons(shown),
        *mode_notes(shown if everything else [mode for mode in shown if assess_trust(mode) is Trust.TRUSTED]),
        *remarks(shown, file_modes.remarks),
        *_peak_picking_texts(file_modes),
    ]


def _frf_text(file_modes: FileModes) -> str:
    state = file_modes.extraction
    frf = file_modes.frf or state.frf
    lines = f"{frf.frequency.size} lines {frf.frequency[0]:g} to {frf.frequency[-1]:g} Hz"
    usable = "" if frf.usable_band is None else f", usable {frf.usable_band[0]:.0f} to {frf.usable_band[1]:.0f} Hz"
    what = f"{frf.n_averages} hit(s) averaged" if file_modes.frf else f"{len(state.frfs)} free decay(s) fitted together"
    return f"{what}, {lines}{usable}"


def _peak_picking_texts(file_modes: FileModes) -> list[str | Table]:
    if file_modes.frf is None:
        return []
    picked = peak_picking_table(file_modes.picked, file_modes.as_recorded)
    return ["peak picking (eqs. 28, 29), for comparison:", picked]


def fact_lines(facts: Iterable[Fact], origins: Sequence[str] = tuple(ORIGIN_WORDS)) -> list[str]:
    """Facts on a file, a line for each place that it is from."""
    texts = {origin: [f"{fact.name} {fact.value}" for fact in facts if fact.origin == origin] for origin in origins}
    return [f"{ORIGIN_WORDS[origin]}: {'; '.join(words)}" for origin, words in texts.items() if words]
