"""Calls about what stays while tasks come and go: devices, sensors, scales, what NI MAX saves."""
