"""The options that say what a recorded file does not say itself."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated, Any

import typer

if TYPE_CHECKING:
    from acquisition import Description

Columns = Annotated[
    str,
    typer.Option(
        help='Of its columns: "frequency,real,imag", "time [s],force [N],acceleration [g]", "frequency=F,frf=H:2".'
    ),
]
Quantity = Annotated[str, typer.Option(help="Of the response: displacement, velocity or acceleration.")]
Unit = Annotated[str, typer.Option(help="Of the response (m/s^2, g), or of an FRF (m/N, um/N, g/N).")]
ForceUnit = Annotated[str, typer.Option(help="Of the force (N, lbf).")]
Rate = Annotated[float | None, typer.Option(help="Samples a second (Hz).")]
Averages = Annotated[int | None, typer.Option(help="Hits that an FRF was averaged from; 1 where nobody says.")]
Response = Annotated[int | None, typer.Option(help="Which of several responses, from 1.")]
FullScale = Annotated[str, typer.Option(help='Of each channel of a WAV file, in its unit: "500,50".')]
Sensitivity = Annotated[str, typer.Option(help='Of each channel in volts: "2.25 mV/N,10.2 mV/g".')]


def described(columns: str, full_scale: str, sensitivity: str = "", **said: Any) -> Description:
    """What these options say, with other fields of Description; ValueError for a full scale that is no number."""
    from acquisition import Description  # `--help` does not wait for it

    try:
        scales = tuple(float(word) for word in full_scale.split(",")) if full_scale else ()
    except ValueError as error:
        raise ValueError(f'--full-scale {full_scale}: give a number for each channel, as in "500,50"') from error
    return Description(_words(columns), full_scale=scales, sensitivity=_words(sensitivity), **said)


def _words(text: str) -> tuple[str, ...]:
    return tuple(word.strip() for word in text.split(",")) if text else ()
