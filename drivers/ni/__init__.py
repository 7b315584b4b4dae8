"""NI-DAQmx through the nidaqmx client: connection, devices, tasks, and the driver that reads them."""
