"""Who may listen beyond this machine: addresses, and keys that are given, missing and taken away."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from urllib.parse import urlsplit

import pytest

from daq_app.acquisition.messages.published import Reply
from daq_app.acquisition.viewers.client import AcquisitionClient, AcquisitionUnreachable
from daq_app.acquisition.viewers.curve import (
    KeyFileError,
    ViewerKeys,
    create_recorder_keys,
    create_viewer_keys,
)
from daq_app.acquisition.viewers.desk import Desk, DeskError
from tests.support.recorder.desk_bench import TOKEN, Counter, listen_until_heard


def test_nothing_listens_beyond_this_machine_without_keys() -> None:
    for bind in ("tcp://0.0.0.0:0", "tcp://*:0", "tcp://192.0.2.1:0"):
        with pytest.raises(DeskError, match="keys"):
            Desk(bind, lambda command: Reply(ok=True), TOKEN)


@pytest.mark.parametrize(
    "bind", ["tcp://127.0.0.1:99999", "", "localhost", "http://127.0.0.1:0", "tcp://127.0.0.1"]
)
def test_an_address_that_is_none_is_told(bind: str) -> None:
    with pytest.raises(DeskError, match="Cannot listen"):
        Desk(bind, lambda command: Reply(ok=True), TOKEN)


def test_with_keys_only_known_viewers_are_heard(counters: Callable[..., Counter], tmp_path: Path) -> None:
    recorder = create_recorder_keys(tmp_path / "keys")
    public, secret = create_viewer_keys(tmp_path / "mine", "bench")
    _, stranger = create_viewer_keys(tmp_path / "theirs", "stranger")
    (tmp_path / "keys" / "viewers" / public.name).write_bytes(public.read_bytes())
    counter = counters("tcp://0.0.0.0:0", tmp_path / "keys")
    address = f"tcp://127.0.0.1:{urlsplit(counter.address).port}"
    with pytest.raises(AcquisitionUnreachable):
        AcquisitionClient(address, TOKEN, timeout_s=0.3)
    with pytest.raises(AcquisitionUnreachable):
        AcquisitionClient(address, TOKEN, keys=ViewerKeys(stranger, recorder), timeout_s=0.3)
    with AcquisitionClient(address, TOKEN, keys=ViewerKeys(secret, recorder)) as client:
        assert client.request("arm").ok
        assert listen_until_heard(client, counter).text == "hear this"
    assert secret.stat().st_mode & 0o077 == 0, "a secret key is for its owner only"


def test_a_viewer_whose_key_is_removed_is_cut_off_at_once(
    counters: Callable[..., Counter], tmp_path: Path
) -> None:
    recorder = create_recorder_keys(tmp_path / "keys")
    admitted = tmp_path / "keys" / "viewers"
    secrets = {}
    for name in ("stays", "goes"):
        public, secrets[name] = create_viewer_keys(tmp_path / name, name)
        (admitted / public.name).write_bytes(public.read_bytes())
    counter = counters("tcp://0.0.0.0:0", tmp_path / "keys")
    address = counter.desk.addresses.commands.replace("0.0.0.0", "127.0.0.1")

    def client(name: str, timeout_s: float) -> AcquisitionClient:
        return AcquisitionClient(
            address, TOKEN, keys=ViewerKeys(secrets[name], recorder), timeout_s=timeout_s
        )

    with client("goes", 5.0) as goes, client("stays", 5.0) as stays:
        assert goes.request("arm", timeout_s=5.0).ok
        (admitted / "goes.key").unlink()
        with pytest.raises(AcquisitionUnreachable):
            while True:  # ends when the counter has looked at its folder
                goes.request("arm", timeout_s=1.0)
        assert stays.request("arm", timeout_s=5.0).ok
    with pytest.raises(AcquisitionUnreachable):
        client("goes", 0.5)


def test_keys_are_never_replaced_silently(tmp_path: Path) -> None:
    public = create_recorder_keys(tmp_path)
    before = public.read_bytes()
    with pytest.raises(KeyFileError, match="exists already"):
        create_recorder_keys(tmp_path)
    assert public.read_bytes() == before
    create_viewer_keys(tmp_path / "mine", "bench")
    with pytest.raises(KeyFileError, match="exists already"):
        create_viewer_keys(tmp_path / "mine", "bench")


def test_keys_that_are_missing_or_broken_are_told(tmp_path: Path) -> None:
    with pytest.raises(DeskError, match="daq-app keys"):
        Desk("tcp://0.0.0.0:0", lambda command: Reply(ok=True), TOKEN, tmp_path)
