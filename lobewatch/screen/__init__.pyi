"""Browser pages: live tap tests, cut recordings, and a dashboard of machines."""

from .dashboard_server import DashboardServer
from .phone_page import RecordingServer
from .web_server import CutScreenServer, ScreenServer

__all__ = ["CutScreenServer", "DashboardServer", "RecordingServer", "ScreenServer"]
