"""The live tap test: connection, hits, trial, self-check, state, outcome; and the devices made of software for it."""

from lobewatch.tap.hit_loop import TapStopped
from lobewatch.tap.session import TapSession, plan_session
from lobewatch.tap.state import TapState, TapStep

__all__ = ["TapSession", "TapState", "TapStep", "TapStopped", "plan_session"]
