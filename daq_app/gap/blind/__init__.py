"""The blind check: cases of an independent simulator, sealed labels, a runner without them, a score.

`daq_app.gap.blind.world` generates; it shares no code with the diagnosis nor with the simulated hardware.
"""
