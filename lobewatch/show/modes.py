"""Show the modes of a tap test or of a recorded file."""

import math
from collections import Counter
from collections.abc import Iterable, Sequence

from rich.table import Table

from acquisition import Fact, HitFlags, Remark, merge_remarks
from dsm import format_rounded, format_with_error
from lobewatch.measurement import FileModes
from lobewatch.measurement.hit_choice import format_unused_hits
from lobewatch.show.terminal.output import JsonObject, Texts, count_noun, new_table, pick
from modal import Mode, Trust, assess_trust, trust_rules

TRUST_SYMBOLS = {Trust.TRUSTED: "", Trust.DOUBTFUL: "!", Trust.REJECTED: "✗"}
"""Mark after a mode."""
MIN_SHOWN_PHASE = 1.0
"""Smallest phase of a modal constant that is shown (degrees)."""
MIN_SHOWN_CORRELATION = 0.5
"""Smallest correlation of errors that is shown."""
MATCHES_NOTE = "matches: number of other measurements with the mode within 0.5 % in frequency"
"""Line below a table with the column "matches"."""
ORIGIN_WORDS = {"file": "from the file", "option": "by option", "default": "assumed"}
"""Words for the origin of a fact on a file."""
FILE_REMARK_CODES = "hit-left-out", "units-differ"
"""Codes of remarks on single hits and files, each of which is shown in full."""
NON_FILE_ORIGINS = "option", "default"
"""Origins of facts that are not in the file."""


def mode_json(mode: Mode) -> JsonObject:
    """Return one mode with its standard errors over the hits and of the fit."""
    std, of_fit = mode.standard_error, mode.fit_error
    return {
        "frequency_hz": mode.frequency,
        "frequency_hz_std": std[0],
        "frequency_hz_std_of_fit": of_fit[0],
        "damping_ratio": mode.damping_ratio,
        "damping_ratio_std": std[1],
        "damping_ratio_std_of_fit": of_fit[1],
        "stiffness_n_per_m": mode.stiffness,
        "stiffness_n_per_m_std": std[2],
        "stiffness_n_per_m_std_of_fit": of_fit[2],
        "interval_95": mode.interval(),
        "correlation": mode.correlation,
        "hits": mode.n_hits,
        "driving_point": mode.is_driving_point,
        **pick(mode, "phase_deg", "phase_deg_std", "coherence", "misfit", "misfit_share"),
        "trust": assess_trust(mode),
        "found_again": mode.match_count,
        "half_power_damping_ratio": mode.half_power_damping,
        "remarks": mode.remarks,
        "method": mode.method,
    }


def sort_modes(modes: Iterable[Mode], *, rejected: bool = True) -> list[Mode]:
    """Sort modes by trust, then frequency; without rejected ones, keep those that a person chose."""

    def is_kept(mode: Mode) -> bool:
        return rejected or assess_trust(mode) is not Trust.REJECTED or any(r.code == "by-hand" for r in mode.remarks)

    return sorted(filter(is_kept, modes), key=lambda mode: ([*Trust].index(assess_trust(mode)), mode.frequency))


def mode_table(modes: Sequence[Mode]) -> Table:
    """Return a table of modes, each value ± its standard error, with a mark on modes that are not trusted.

    The phase and the number of other FRFs with the mode are columns only if some mode has them.
    """
    with_phase = any(abs(mode.phase_deg) > MIN_SHOWN_PHASE for mode in modes)
    with_matches = any(mode.match_count for mode in modes)
    headings = [*(["phase (deg)"] if with_phase else []), *(["matches"] if with_matches else [])]
    table = new_table("fn (Hz)", "zeta (%)", "K (N/um)", *headings, "<")
    percents = False, False, not with_phase
    for mode in modes:
        values = (mode.frequency, mode.damping_ratio, mode.stiffness), mode.standard_error, (1.0, 0.01, 1e6), percents
        texts = [
            "unknown" if math.isnan(value) else format_with_error(value, std, scale, percent=percent)
            for value, std, scale, percent in zip(*values, strict=True)
        ]
        phase = format_with_error(mode.phase_deg, mode.phase_deg_std or None) if mode.phase_deg else "0"
        texts += [phase] if with_phase else []
        texts += ["" if mode.match_count is None else "{} of {}".format(*mode.match_count)] if with_matches else []
        table.add_row(*texts, TRUST_SYMBOLS[assess_trust(mode)])
    return table


def mode_notes(modes: Sequence[Mode]) -> list[str]:
    """Return lines below a table of modes: source of ±, matches, correlated errors."""
    hits = max((mode.n_hits for mode in modes), default=0)
    how = "jackknife" if all(mode.has_stiffness for mode in modes) else "from the influence of each hit"
    lines = [f"± is the standard error over the {hits} hits ({how}, {hits - 1} degrees of freedom)"] if hits else []
    lines += [MATCHES_NOTE] if any(mode.match_count for mode in modes) else []
    for (i, j), names in (((0, 1), "fn and zeta"), ((0, 2), "fn and K"), ((1, 2), "zeta and K")):
        of = [(mode.correlation[i, j], mode.frequency) for mode in modes]
        high = [f"{value:+.2f} ({at:.0f} Hz)" for value, at in of if abs(value) > MIN_SHOWN_CORRELATION]
        if high:
            lines.append(f"correlation of the errors of {names}: {', '.join(high)}")
    return lines


def mode_remark_lines(modes: Sequence[Mode], remarks: Sequence[Remark]) -> list[str]:
    """Return a line for each remark on modes and for each further one, the same remark of several modes as one."""
    return [str(remark) for remark in merge_remarks([*(remark for mode in modes for remark in mode.remarks), *remarks])]


def grouped_remark_lines(modes: Sequence[Mode], remarks: Sequence[Remark]) -> list[str]:
    """Return a line for each code of a remark: that of the first mode, and the other modes with the same code."""
    by_code: dict[str, list[Remark]] = {}
    for remark in (*(remark for mode in modes for remark in mode.remarks), *remarks):
        by_code.setdefault(remark.code, []).append(remark)
    lines = list[str]()
    for same in by_code.values():
        first, *others = map(str, merged := merge_remarks(same))
        about = ", ".join(remark.about for remark in merged[1:])
        lines += [f"{first} (also {about})"] if about else [first, *others]
    return lines


def trust_summary(modes: Sequence[Mode], *, everything: bool) -> str:
    """Return how many modes are trusted, doubtful and rejected, and how to see more of them."""
    has_doubtful = any(assess_trust(mode) is Trust.DOUBTFUL for mode in modes)
    looked = not has_doubtful or any(mode.match_count for mode in modes)
    hints = [] if looked else ["compare with other files: --beside"]
    hints = hints if everything or not modes else ["all modes and remarks: --all", *hints]
    return count_by_trust(modes) + (f" ({', '.join(hints)})" if hints else "")


def count_by_trust(modes: Sequence[Mode]) -> str:
    """Return how many modes are trusted, doubtful and rejected."""
    count = Counter(assess_trust(mode) for mode in modes)
    return ", ".join(f"{count[trust]} {trust}" for trust in Trust)


def trust_reasons(modes: Sequence[Mode]) -> list[str]:
    """Return the modes without a driving point, and the rules by which modes are doubtful or rejected."""
    opposed = (mode for mode in modes if any(remark.code == "not-driving-point" for remark in mode.remarks))
    elsewhere = [f"{mode.frequency:.0f} Hz" for mode in opposed]
    lines = [f"not at a driving point: {', '.join(elsewhere)}"] if elsewhere else []
    for trust in (Trust.DOUBTFUL, Trust.REJECTED):
        alike = (mode for mode in modes if assess_trust(mode) is trust)
        texts = [f"{mode.frequency:.0f} Hz ({', '.join(code for code, _ in trust_rules(mode))})" for mode in alike]
        lines += [f"{TRUST_SYMBOLS[trust]} {trust}: {', '.join(texts)}"] if texts else []
    return lines


def peak_picking_table(picked: Sequence[Mode], fitted: Sequence[Mode]) -> Table:
    """Return a table of modes by peak picking, with the difference of each from the nearest fitted mode."""
    table = new_table("fn (Hz)", "zeta (%)", "K (N/um)", "<difference from the fit")
    for mode in picked:
        fit, difference = min(fitted, key=lambda fit: abs(fit.frequency - mode.frequency), default=None), "not fitted"
        if fit is not None and abs(fit.frequency - mode.frequency) < mode.damping_ratio * mode.frequency:
            zeta, k = mode.damping_ratio / fit.damping_ratio - 1, mode.stiffness / fit.stiffness - 1
            difference = f"fn {mode.frequency - fit.frequency:+.2g} Hz, zeta {100 * zeta:+.1f} %, K {100 * k:+.1f} %"
        stiffness = format_rounded(mode.stiffness, scale=1e6, digits=5)
        table.add_row(f"{mode.frequency:.5g}", f"{100 * mode.damping_ratio:.5g}", stiffness, difference)
    return table


def hits_json(faults: Sequence[HitFlags], flags: Sequence[HitFlags]) -> list[JsonObject]:
    """Return each hit with its number, its verdict and codes, and whether it is averaged, which leaves no flags."""
    return [
        {"number": number, "verdict": found.words, "codes": found.codes, "used": not left}
        for number, (found, left) in enumerate(zip(faults, flags, strict=True), 1)
    ]


def file_modes_json(file_modes: FileModes) -> JsonObject:
    """Return the modes of one file, fitted and by peak picking."""
    frf = file_modes.frf
    return {
        "file": str(file_modes.path),
        "n_averages": frf and frf.n_averages,
        "n_hits_found": file_modes.n_found,
        "usable_band_hz": frf and frf.usable_band,
        "facts": file_modes.facts,
        "hits": hits_json(file_modes.hits, file_modes.hit_flags),
        "hit_decisions": file_modes.hit_decisions,
        "by_hand": file_modes.by_hand,
        "modes": list(map(mode_json, file_modes.fitted)),
        "peak_picking": list(map(mode_json, file_modes.picked)),
        "remarks": file_modes.remarks,
    }


def file_modes_texts(file_modes: FileModes, *, everything: bool = False) -> Texts:
    """Return the modes of one file in words; everything: rejected modes and each single remark, too."""
    shown = sort_modes(file_modes.fitted, rejected=everything)
    trusted = [mode for mode in shown if assess_trust(mode) is Trust.TRUSTED]
    remarks = mode_remark_lines if everything else grouped_remark_lines
    of_files = [remark for remark in file_modes.remarks if remark.code in FILE_REMARK_CODES]
    others = [remark for remark in file_modes.remarks if remark not in of_files]
    texts: Texts = [
        f"{file_modes.path.name}: {_frf_text(file_modes)}",
        *fact_lines(file_modes.facts, NON_FILE_ORIGINS),
        *filter(None, [format_unused_hits(file_modes.hit_flags, file_modes.places)]),
        *map(str, merge_remarks(of_files)),
        mode_table(shown),
        trust_summary(file_modes.fitted, everything=everything),
        *trust_reasons(shown),
        *mode_notes(shown if everything else trusted),
        *remarks(shown, others),
    ]
    if file_modes.frf is not None:
        heading = "for comparison, peak picking by eqs. (28) and (29) of Gaber & Hashemi:"
        texts += [heading, peak_picking_table(file_modes.picked, file_modes.as_recorded)]
    return texts


def _frf_text(file_modes: FileModes) -> str:
    state = file_modes.extraction
    frf = file_modes.frf or state.frf
    lines = f"{frf.frequency.size} lines {frf.frequency[0]:g} to {frf.frequency[-1]:g} Hz"
    usable = "" if frf.usable_band is None else f", usable {frf.usable_band[0]:.0f} to {frf.usable_band[1]:.0f} Hz"
    n, n_found = frf.n_averages if file_modes.frf else len(state.frfs), file_modes.n_found
    noun, done = ("hit", "averaged") if file_modes.frf else ("free decay", "fitted together")
    what = f"{n} of {count_noun(n_found, noun)} {done}" if n_found > n else f"{count_noun(n, noun)} {done}"
    return f"{what}, {lines}{usable}"


def fact_lines(facts: Iterable[Fact], origins: Sequence[str] = tuple(ORIGIN_WORDS)) -> list[str]:
    """Return the facts on a file, a line for each origin."""
    texts = {origin: [f"{fact.name} {fact.value}" for fact in facts if fact.origin == origin] for origin in origins}
    return [f"{ORIGIN_WORDS[origin]}: {', '.join(words)}" for origin, words in texts.items() if words]
