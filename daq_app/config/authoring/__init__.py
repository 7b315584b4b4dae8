"""Writing a rig file for a new wall: block, sensors from a table, terminals, text with comments."""

from daq_app.config.authoring.block import Block
from daq_app.config.authoring.layout import spread_sensors
from daq_app.config.authoring.rig_text import wiring_lines, write_rig_text
from daq_app.config.authoring.sensor_table import read_sensor_table

__all__ = ["Block", "read_sensor_table", "spread_sensors", "wiring_lines", "write_rig_text"]
