"""Channel-configuration layer: rig model, hardware catalogue, planner."""

from daq_app.config.connection import Connection, parse_connection
from daq_app.config.errors import ConfigError, Problem
from daq_app.config.loader import load_rig, parse_rig
from daq_app.config.planning.plan import PlannedChannel, PlannedTask, PlanNote, TaskPlan
from daq_app.config.planning.planner import plan_tasks
from daq_app.config.rig import Channel, Rig
from daq_app.config.scaling import Scaling

__all__ = [
    "Channel",
    "ConfigError",
    "Connection",
    "PlanNote",
    "PlannedChannel",
    "PlannedTask",
    "Problem",
    "Rig",
    "Scaling",
    "TaskPlan",
    "load_rig",
    "parse_connection",
    "parse_rig",
    "plan_tasks",
]
