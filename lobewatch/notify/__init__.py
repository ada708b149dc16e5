"""Publish the status of machines to MQTT brokers and Prometheus."""
