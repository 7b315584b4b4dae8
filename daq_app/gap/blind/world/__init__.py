"""An independent simulator of release tests: own mechanics, own integrator, own sensors.

It imports the configuration only. It must never import the diagnosis (`daq_app.gap.core`,
`daq_app.gap.rocking_model`) nor the simulated hardware: an import contract in pyproject.toml holds it.
A diagnosis that is checked on data made by its own equations proves nothing.
"""
