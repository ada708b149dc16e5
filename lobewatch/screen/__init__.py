"""The operator's screen in a browser: a page that follows a tap test, one that follows a cut that is listened to, and a
dashboard of machines that starts tests."""

from lobewatch.screen.dashboard_server import DashboardServer
from lobewatch.screen.screen_server import CutScreenServer, ScreenServer

__all__ = ["CutScreenServer", "DashboardServer", "ScreenServer"]
