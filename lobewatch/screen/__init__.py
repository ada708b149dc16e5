"""The operator's screen in a browser: pages that follow a tap test and a cut, and a dashboard of machines."""

from lobewatch.screen.dashboard_server import DashboardServer
from lobewatch.screen.screen_server import CutScreenServer, ScreenServer

__all__ = ["CutScreenServer", "DashboardServer", "ScreenServer"]
