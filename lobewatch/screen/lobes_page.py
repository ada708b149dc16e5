"""Serve the page that shows stability lobes of stated modes."""

import asyncio
from typing import Annotated, Any, Literal

import msgspec
from aiohttp import web

from lobewatch.logbook.stated_modes import StatedCut, build_stated_machine, compare_stated_modes, parse_mode
from lobewatch.machine.settings.speed_range import parse_speed_range
from lobewatch.machine.settings.unit_text import convert_unit_texts
from lobewatch.screen.access_control import WATCH_ROUTE_PREFIX
from lobewatch.show.figures.drawing import render_svg
from lobewatch.show.figures.lobe_figures import plot_comparison
from lobewatch.show.programs.advice import comparison_json
from lobewatch.show.terminal.output import JsonObject, plain_json

Modes = Annotated[tuple[str, ...], msgspec.Meta(max_length=12)]
"""Modes as texts; the largest number is chosen, a tool tip has fewer."""


class StatedLobes(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """Values that a person enters for lobes of stated modes."""

    modes: Annotated[Modes, msgspec.Meta(min_length=1)]
    """Modes in x, such as "600 Hz 3% 10 N/um"."""
    teeth: Annotated[int, msgspec.Meta(ge=1, le=40)]
    """Number of flutes."""
    material: str
    """Material of `lobewatch materials`."""
    modes_y: Modes = ()
    """Modes in y; empty if they are as in x."""
    diameter_mm: float | None = None
    """Tool diameter (mm)."""
    radial_depth_mm: float | None = None
    """Radial depth of cut ae (mm)."""
    direction: Literal["up", "down"] = "down"
    """Milling direction."""
    speeds: str = "1000 24000"
    """Lowest and highest spindle speed (rpm)."""
    speed_rpm: float | None = None
    """Spindle speed of a verdict (rpm)."""
    depth_mm: float | None = None
    """Axial depth of a verdict (mm)."""


def parse_stated_lobes(body: bytes) -> StatedLobes:
    """Parse the values that a page sent, lengths also with a unit; ValueError that names an invalid value."""
    try:
        values = msgspec.json.decode(body)
    except (msgspec.DecodeError, UnicodeDecodeError, RecursionError):
        raise ValueError("the request is not JSON. Load the page again.") from None
    try:
        return msgspec.convert(convert_unit_texts(values), StatedLobes, strict=False)
    except (msgspec.ValidationError, RecursionError) as error:
        raise ValueError(f"a value is missing or wrong: {error}. Correct it.") from None


def compute_stated_lobes(stated: StatedLobes) -> JsonObject:
    """Return lobes, pockets, the verdict and the figure (`svg`) of stated modes. ValueError for an invalid value."""
    low, high = parse_speed_range(stated.speeds)
    sizes = stated.diameter_mm, stated.radial_depth_mm
    cut = StatedCut(stated.teeth, stated.material, *sizes, stated.direction, low, high)
    x, y = ([*map(parse_mode, modes)] for modes in (stated.modes, stated.modes_y))
    comparison = compare_stated_modes(cut, x, y, stated.speed_rpm, stated.depth_mm)
    figure = plot_comparison(build_stated_machine(cut), comparison, ())
    return plain_json(comparison_json(comparison, comparison.remarks)) | {"svg": render_svg(figure)}


def add_stated_lobes(application: web.Application, prefix: str) -> None:
    """Serve the lobes of stated modes at `prefix`chart, one at a time."""
    busy = asyncio.Lock()

    async def respond(request: web.Request) -> web.Response:
        stated = parse_stated_lobes(await request.read())
        async with busy:
            answer: Any = await asyncio.to_thread(compute_stated_lobes, stated)
        return web.json_response(answer)

    application.router.add_post(f"{prefix}chart", respond, name=f"{WATCH_ROUTE_PREFIX}chart")
