"""From sensors to NI-DAQmx tasks."""
