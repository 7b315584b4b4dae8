"""``python -m daq_app.acquisition``: the acquisition process."""

from daq_app.acquisition.process.process import main

if __name__ == "__main__":
    raise SystemExit(main())
