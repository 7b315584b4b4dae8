"""The sensor chain: from what the wall does to what stands at the terminals."""

from sim_hardware.sensors.chain import SensorChain
from sim_hardware.sensors.scene import Knock, Scene

__all__ = ["Knock", "Scene", "SensorChain"]
