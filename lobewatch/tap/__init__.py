"""Live tap test: device connection, hits, self-check, state and outcome, and the emulated devices for it."""

from lobewatch.tap.hit_loop import TapStopped
from lobewatch.tap.session import TapSession, plan_session
from lobewatch.tap.state import TapState, TapStep

__all__ = ["TapSession", "TapState", "TapStep", "TapStopped", "plan_session"]
