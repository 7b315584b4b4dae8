"""The server as a program: command line, life span, determinism; and the export of NI MAX."""

from __future__ import annotations

import contextlib
import re
import signal
import socket
import subprocess
import sys
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import grpc
import nidaqmx
import nidaqmx.system
import numpy as np
import psutil
import pytest
from nidaqmx.constants import AcquisitionType
from nidaqmx.grpc_session_options import GrpcSessionOptions

from daq_app.config.errors import ConfigError
from sim_hardware.control import SimControl, SimControlError
from sim_hardware.daqmx_server.inventory.max_export import load_max_export
from sim_hardware.daqmx_server.options import parser
from sim_hardware.daqmx_server.program import build_bench, main
from sim_hardware.daqmx_server.services.server import DaqmxServer, missing_calls, missing_table

RIG = Path(__file__).parents[3] / "configs" / "fr1.toml"
Start = Callable[..., tuple[subprocess.Popen[str], str]]


@pytest.fixture
def start() -> Iterator[Start]:
    """Start the program; answers the process and its address."""
    processes: list[subprocess.Popen[str]] = []

    def run(*options: str) -> tuple[subprocess.Popen[str], str]:
        process = subprocess.Popen(
            [sys.executable, "-m", "sim_hardware.daqmx_server", "--config", str(RIG), *options],
            stdout=subprocess.PIPE,
            text=True,
        )
        processes.append(process)
        assert process.stdout is not None
        line = process.stdout.readline()
        match = re.fullmatch(r"Server listening on port (\d+)\n", line)
        assert match, line
        return process, f"127.0.0.1:{match[1]}"

    yield run
    for process in processes:
        process.kill()
        process.wait()
        assert process.stdout is not None
        process.stdout.close()


def _record(address: str, seconds: float) -> np.ndarray:
    with grpc.insecure_channel(address) as channel:
        options = GrpcSessionOptions(channel, "")
        with nidaqmx.Task(grpc_options=options) as task:
            task.ai_channels.add_ai_voltage_chan("cDAQ1Mod3/ai0:4", min_val=-10, max_val=10)
            task.timing.cfg_samp_clk_timing(4000.0, sample_mode=AcquisitionType.CONTINUOUS)
            return np.array(task.read(round(4000 * seconds), timeout=60.0))


@contextmanager
def _in_process(*options: str) -> Iterator[str]:
    """The same server in this process: address."""
    server = DaqmxServer(build_bench(parser().parse_args(["--config", str(RIG), *options])))
    server.start()
    try:
        yield f"127.0.0.1:{server.port}"
    finally:
        server.stop()


def test_same_seed_same_volts_in_another_process_at_another_speed(start: Start) -> None:
    """Loopback only; the volts are those of any server with this rig and seed; a kill is a real death."""
    process, address = start("--seed", "7", "--speed", "50")
    listening = {c.laddr.ip for c in psutil.Process(process.pid).net_connections() if c.status == "LISTEN"}
    assert {ip.removeprefix("::ffff:") for ip in listening} == {"127.0.0.1"}
    there = _record(address, 5.0)
    with _in_process("--seed", "7", "--speed", "max") as here:
        assert np.array_equal(_record(here, 5.0), there)
    with _in_process("--seed", "8", "--speed", "max") as here:
        assert not np.array_equal(_record(here, 0.05), there[:, :200])
    pulled = there[0, -200:].mean() - there[0, :200].mean()
    assert abs(pulled) > 0.05  # a wire potentiometer follows the pull that begins after 3 s
    # A server that dies may take its answer along.
    with SimControl(address) as control, contextlib.suppress(SimControlError):
        control.command("fault", kind="server_killed")
    assert process.wait(30) != 0
    with pytest.raises(nidaqmx.errors.RpcError):
        _record(address, 0.1)


def test_ends_well_on_a_signal() -> None:
    """Ctrl-C while it serves: exit code 0. Run in this process, with its handlers put back afterwards."""
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]

    def interrupt() -> None:
        with grpc.insecure_channel(f"127.0.0.1:{port}") as channel:
            grpc.channel_ready_future(channel).result(timeout=60)
        signal.raise_signal(signal.SIGINT)

    numbers = [getattr(signal, n) for n in ("SIGINT", "SIGTERM", "SIGBREAK") if hasattr(signal, n)]
    before = {number: signal.getsignal(number) for number in numbers}
    helper = threading.Thread(target=interrupt)
    helper.start()
    try:
        assert main(["--config", str(RIG), "--port", str(port)]) == 0
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
        helper.join()


def test_faults_of_a_script(tmp_path: Path) -> None:
    script = tmp_path / "faults.toml"
    script.write_text(
        '[[fault]]\nkind = "channel_saturated"\ntarget = "cDAQ1Mod3/ai0"\nat_sample = 300\nfor_s = 0.05\n'
    )
    with _in_process("--faults", str(script), "--speed", "max") as address:
        assert np.flatnonzero(_record(address, 0.2)[0] > 9.99).tolist() == list(range(300, 500))


def test_commanded_wall_waits() -> None:
    with _in_process("--wall", "commanded", "--speed", "max") as address, SimControl(address) as control:
        assert control.command("status")["state"] == "upright"
        control.command("pull", theta0_over_alpha=0.25, duration_s=1.0)
        _record(address, 2.0)
        assert control.command("status")["state"] == "held"
        with pytest.raises(SimControlError, match="knows no command"):
            control.command("push")


def test_a_killed_parent_takes_the_server_along(start: Start, tmp_path: Path) -> None:
    """With --parent-pid the server ends by itself; until then it serves a lab's own chassis."""
    export = tmp_path / "lab.ini"
    export.write_text(_EXPORT)
    parent = subprocess.Popen([sys.executable, "-c", "input()"], stdin=subprocess.PIPE)
    process, address = start("--parent-pid", str(parent.pid), "--max-export", str(export))
    with grpc.insecure_channel(address) as channel:
        system = nidaqmx.system.System.remote(GrpcSessionOptions(channel, ""))
        assert [device.name for device in system.devices] == ["Card", "Lab", "LabMod1", "LabMod2"]
    parent.kill()
    parent.wait()
    assert process.wait(20) == 0


def test_bad_configuration_is_one_sentence_and_code_2(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    bad = tmp_path / "bad.toml"
    bad.write_text('name = "x"\n')
    assert main(["--config", str(bad)]) == 2
    assert main(["--config", str(RIG), "--theta0-over-alpha", "3"]) == 2
    assert main(["--config", str(RIG), "--max-export", str(bad)]) == 2
    assert "Traceback" not in capsys.readouterr().err


_EXPORT = """[DAQmx]
MajorVersion = 24

[DAQmxDevice Card]
ProductType = PXIe-6363
DevSerialNum = 0x1A2B3C4D
ProductNum = 0x7435C4C4
BusType = PXIe
PXI.ChassisNum = 1
PXI.SlotNum = 3

[DAQmxCDAQChassis Lab]
ProductType = cDAQ-9185
DevSerialNum = 0x0
BusType = TCP/IP

[DAQmxCDAQModule LabMod1]
ProductType = NI 9205
DevSerialNum = 0x1F00AA
CompactDAQ.ChassisDevName = Lab
CompactDAQ.SlotNum = 1

[DAQmxCDAQModule LabMod2]
ProductType = NI 9361
CompactDAQ.ChassisDevName = Lab
CompactDAQ.SlotNum = 2

[DAQmxTask Old]
Channels = Old/v0
"""


@pytest.mark.parametrize("encoding", ["utf-8", "utf-16"])
def test_inventory_of_an_ni_max_export(tmp_path: Path, encoding: str) -> None:
    path = tmp_path / "lab.ini"
    path.write_text(_EXPORT, encoding=encoding)
    inventory = load_max_export(path).inventory
    assert list(inventory.devices) == ["Card", "Lab", "LabMod1", "LabMod2"]
    card, chassis, module, counter = inventory.devices.values()
    assert (card.serial, card.product_number, len(card.physical_channels)) == (0x1A2B3C4D, 0x7435C4C4, 32)
    assert chassis.is_chassis
    assert (module.chassis, module.slot, module.serial) == ("Lab", 1, 0x1F00AA)
    assert (counter.product_name, counter.physical_channels, len(counter.counters)) == ("NI 9361", (), 8)


@pytest.mark.parametrize(
    "text",
    [
        "",
        "[DAQmx]\n",
        "[DAQmxDevice A]\nBusType = USB\n",
        "no section\n",
        "[DAQmxDevice A]\nProductType = X\nDevSerialNum = many\n",
    ],
)
def test_what_is_no_ni_max_export(tmp_path: Path, text: str) -> None:
    path = tmp_path / "lab.ini"
    path.write_text(text)
    with pytest.raises(ConfigError, match=r"lab\.ini"):
        load_max_export(path)


def test_the_page_lists_the_calls_that_have_no_handler() -> None:
    page = Path(__file__).parents[3] / "docs/how-to/nidaqmx-without-hardware.md"
    said = page.read_text(encoding="utf-8")
    assert f"<!-- missing: begin -->\n{missing_table()}\n<!-- missing: end -->" in said
    assert set(missing_calls()).isdisjoint({"ReadAnalogF64", "StartTask"})


def test_the_page_s_fixture_and_program_run_as_they_stand_there(tmp_path: Path) -> None:
    page = (Path(__file__).parents[3] / "docs/how-to/nidaqmx-without-hardware.md").read_text(encoding="utf-8")
    blocks = re.findall(r"```python\n(.*?)```", page, re.DOTALL)
    program = next(block for block in blocks if "GrpcSessionOptions(channel" in block and "Task(" in block)
    fixture = next(block for block in blocks if "pytest.fixture" in block)
    body = program[program.index("with nidaqmx.Task") :].replace("grpc_options=options", "grpc_options=daq")
    test = "def test_it(daq):\n" + "".join(f"    {line}\n" for line in body.splitlines())
    file = tmp_path / "test_page.py"
    file.write_text(
        f"import subprocess, sys\nimport grpc, nidaqmx, pytest\n\n{fixture}\n{test}", encoding="utf-8"
    )
    command = [sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider", str(file)]
    done = subprocess.run(command, capture_output=True, text=True, check=False, cwd=tmp_path)
    assert done.returncode == 0, done.stdout
    assert "1 passed" in done.stdout
