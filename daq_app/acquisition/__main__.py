"""``python -m daq_app.acquisition``: the acquisition process."""

from daq_app.acquisition.process.process import main
from daq_app.streams import let_output_fail, use_utf8

if __name__ == "__main__":
    use_utf8()
    let_output_fail()  # whoever started us may be gone; the recording goes on
    raise SystemExit(main())
