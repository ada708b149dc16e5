"""The operator's screen in a browser: pages that follow a tap test and a cut, and a dashboard of machines."""

from .dashboard_server import DashboardServer
from .web_server import CutScreenServer, ScreenServer

__all__ = ["CutScreenServer", "DashboardServer", "ScreenServer"]
