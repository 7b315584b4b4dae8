"""The blind check: cases from an independent simulator, sealed labels, a runner that cannot read them, a score.

`daq_app.gap.blind.world` generates; it shares no code with the diagnosis nor with the simulated hardware.
"""
