"""Channel-configuration layer: rig model, hardware catalogue, planner.

Each name is loaded when it is first used: what only words a number needs no catalogue of products.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from daq_app.config.first_use import at_first_use

if TYPE_CHECKING:
    from daq_app.config.connection import Connection, parse_connection
    from daq_app.config.errors import ConfigError, Problem
    from daq_app.config.loader import load_rig, parse_rig
    from daq_app.config.planning.plan import PlannedChannel, PlannedTask, PlanNote, TaskPlan
    from daq_app.config.planning.planner import plan_tasks
    from daq_app.config.rig import Channel, Rig
    from daq_app.config.scaling import Scaling

_PLACES = {
    "connection": ("Connection", "parse_connection"),
    "errors": ("ConfigError", "Problem"),
    "loader": ("load_rig", "parse_rig"),
    "planning.plan": ("PlannedChannel", "PlannedTask", "PlanNote", "TaskPlan"),
    "planning.planner": ("plan_tasks",),
    "rig": ("Channel", "Rig"),
    "scaling": ("Scaling",),
}
"""Module below this one → the names that it brings."""

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

__getattr__, __dir__ = at_first_use(__name__, _PLACES)
