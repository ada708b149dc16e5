"""The live tap test: connection, hits, trial, self-check, state, outcome."""

from lobewatch.tap.emulated_spindle import emulate_machine, emulated_structure, emulator, with_bearing_stiffness
from lobewatch.tap.live_signal import LiveSignal
from lobewatch.tap.plan_session import plan_session
from lobewatch.tap.plug import Plug, open_source
from lobewatch.tap.self_check import quiet_stretch
from lobewatch.tap.sensor_doubts import sensor_doubts
from lobewatch.tap.session import TapSession, TapStopped
from lobewatch.tap.state import Plots, TakenHit, TapState, TapStep
from lobewatch.tap.stories.demo import DemoTap, SpindleState, age_spindle
from lobewatch.tap.trial import Trial

__all__ = [
    "DemoTap",
    "LiveSignal",
    "Plots",
    "Plug",
    "SpindleState",
    "TakenHit",
    "TapSession",
    "TapState",
    "TapStep",
    "TapStopped",
    "Trial",
    "age_spindle",
    "emulate_machine",
    "emulated_structure",
    "emulator",
    "open_source",
    "plan_session",
    "quiet_stretch",
    "sensor_doubts",
    "with_bearing_stiffness",
]
