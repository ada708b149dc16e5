"""Device drivers, driver registry and port scan."""
