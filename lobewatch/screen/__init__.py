"""The operator's screen in a browser: one page that follows a tap test, and a dashboard of machines that starts one."""

from lobewatch.screen.dashboard_server import DashboardServer
from lobewatch.screen.screen_server import ScreenServer

__all__ = ["DashboardServer", "ScreenServer"]
