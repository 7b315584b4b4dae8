"""Attributes that a task keeps as plain values: got, set and reset by NI's metadata."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Final

from nidaqmx import constants

from sim_hardware.daqmx_server.bench.bench import Bench
from sim_hardware.daqmx_server.channels import metadata
from sim_hardware.daqmx_server.errors import Code, DaqmxError
from sim_hardware.daqmx_server.services.attributes.groups import unsupported
from sim_hardware.daqmx_server.tasks.task import Task, task_named
from sim_hardware.daqmx_server.timing import triggers

Derived = dict[str, Callable[[Task], Any]]


class SettingsGroup:
    """Attributes that a task keeps as plain values: types and defaults by NI's metadata, some derived.

    `defaults` are those that are not the zero of their type; `absent` are attributes of hardware that is
    not simulated (−200452).
    """

    def __init__(
        self,
        group: str,
        settings: Callable[[Task], dict[str, Any]],
        defaults: dict[str, Any],
        derived: Derived,
        while_running: frozenset[str] = frozenset(),
        absent: frozenset[str] = frozenset(),
    ) -> None:
        self._group = group
        self._settings = settings
        self._defaults = defaults
        self._derived = derived
        self._while_running = while_running
        self._absent = absent

    def get(self, bench: Bench, request: Any, name: str) -> Any:
        task = task_named(bench, request.task.name)
        if name in self._derived:
            return self._derived[name](task)
        self._check(name)
        value = self._settings(task).get(name, self._defaults.get(name))
        return metadata.default_of(self._group, name) if value is None else value

    def set(self, bench: Bench, request: Any, name: str, value: Any) -> None:
        task = self._changing(bench, request, name)
        if isinstance(value, int) and not metadata.is_value(self._group, name, value):
            raise DaqmxError(Code.INVALID_VALUE, f"Property: DAQmx_{name}\nRequested Value: {value}")
        self._settings(task)[name] = value

    def reset(self, bench: Bench, request: Any, name: str) -> None:
        task = self._changing(bench, request, name)
        self._settings(task).pop(name, None)
        if name in _RESET_TO:
            self._settings(task)[name] = _RESET_TO[name]

    def _changing(self, bench: Bench, request: Any, name: str) -> Task:
        task = task_named(bench, request.task.name)
        self._check(name)
        no_trigger = task.io in ("CI", "CO") and name.startswith(("REF_TRIG", "HSHK_TRIG"))
        if name not in metadata.resettable(self._group) or no_trigger:
            raise unsupported(name)
        if name not in self._while_running:
            task.configure()
        return task

    def _check(self, name: str) -> None:
        known = metadata.attributes_of(self._group)
        if (name not in known and name not in self._defaults) or name in self._absent:
            raise unsupported(name)


_RESET_TO: Final = {
    "START_TRIG_TYPE": triggers.NONE,
    "REF_TRIG_TYPE": triggers.NONE,
    "SAMP_QUANT_SAMP_MODE": constants.AcquisitionType.CONTINUOUS.value,
}
"""Values after a reset, where they are not those of a task that nothing was set in."""
