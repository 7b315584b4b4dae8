"""How the window is opened: the chooser, the command line, and what is refused in words."""

from __future__ import annotations

import subprocess
import sys

import pytest
from typer.testing import CliRunner

# qtbot: this module needs Qt; tests/monitor/conftest.py skips it where Qt cannot start.
from daq_app.cli.app import build_app
from daq_app.config import ConfigError, load_rig
from daq_app.monitor.pages.start_page import StartWindow, known_rigs
from daq_app.monitor.window.app import campaign_beside, refuse_other_rig


@pytest.fixture
def runner():
    return CliRunner()


def test_viewing_a_missing_file_is_refused(runner, tmp_path):
    result = runner.invoke(build_app(), ["view", str(tmp_path / "none.h5")])
    assert result.exit_code == 2
    assert "there is no file" in result.stderr


def test_one_key_without_the_other_is_refused(runner):
    result = runner.invoke(
        build_app(), ["monitor", "--connect", "tcp://127.0.0.1:1", "--key", "me.key_secret"]
    )
    assert result.exit_code == 2
    assert "--server-key" in result.stderr


@pytest.mark.parametrize("command", ["monitor", "view"])
def test_help_has_an_example(runner, command):
    result = runner.invoke(build_app(), [command, "--help"])
    assert result.exit_code == 0
    assert f"Example: daq-app {command}" in result.stdout


def test_rigs_used_before_come_first_and_only_once(settings, configs, repository):
    settings.add_recent_rig(configs / "fr2.toml")
    settings.add_recent_rig(configs / "gone.toml")
    rigs = known_rigs(settings, repository)
    assert rigs[0] == (configs / "fr2.toml").resolve()
    assert len(set(rigs)) == len(rigs) >= 4


def test_a_long_name_of_a_rig_is_whole(qtbot, settings, tmp_path):
    chooser = StartWindow(settings, tmp_path, lambda _rig, _out: None)
    qtbot.addWidget(chooser)
    chooser.show()
    assert chooser.rigs.count() and chooser.rigs.horizontalScrollBar().maximum() == 0


def test_the_chooser_shows_why_a_rig_cannot_be_opened_and_stays(qtbot, settings, tmp_path):
    def start(rig, folder):
        load_rig(rig)

    window = StartWindow(settings, tmp_path, start)
    qtbot.addWidget(window)
    bad = tmp_path / "bad.toml"
    bad.write_text("schema_version = 1\n", encoding="utf-8")
    window.rigs.clear()
    window._add(bad)
    window.rigs.setCurrentRow(0)
    window.go.click()
    qtbot.waitUntil(lambda: "bad.toml" in window.message.text(), timeout=60_000)
    assert window.go.isEnabled()


def test_the_chooser_closes_once_the_window_is_open(qtbot, settings, tmp_path, configs):
    opened = []
    window = StartWindow(settings, tmp_path, lambda rig, folder: opened.append((rig, folder)))
    qtbot.addWidget(window)
    window.show()
    window.rigs.clear()
    window._add(configs / "fr1.toml")
    window.rigs.setCurrentRow(0)
    window.go.click()
    qtbot.waitUntil(lambda: window.isHidden(), timeout=60_000)
    assert opened == [(configs / "fr1.toml", tmp_path)]


def test_the_campaign_beside_the_rig_is_found(configs, tmp_path):
    assert campaign_beside(configs / "fr1.toml") == configs / "campaigns" / "costa.toml"
    assert campaign_beside(tmp_path / "fr1.toml") is None


def test_a_folder_in_which_another_rig_runs_is_refused_in_words(configs, tmp_path):
    about = {"rig_text": (configs / "fr1.toml").read_text(encoding="utf-8"), "rig_name": "fr1"}
    refuse_other_rig(configs / "fr1.toml", tmp_path, about)
    with pytest.raises(ConfigError, match=r"fr1 is being recorded into .* fr2 was chosen") as refused:
        refuse_other_rig(configs / "fr2.toml", tmp_path, about)
    assert "side by side" in str(refused.value)


def test_a_rig_file_that_was_changed_since_is_told_from_another_rig(configs, tmp_path):
    text = (configs / "fr1.toml").read_text(encoding="utf-8")
    changed = tmp_path / "fr1.toml"
    changed.write_text(text.replace("post_rest_s = 2.0", "post_rest_s = 3.0"), encoding="utf-8")
    with pytest.raises(ConfigError, match="changed since"):
        refuse_other_rig(changed, tmp_path, {"rig_text": text, "rig_name": "fr1"})


def test_the_window_opens_without_loading_what_analyses_and_draws_reports():
    asked = "import sys, daq_app.monitor.window.app; print(*sys.modules)"
    loaded = subprocess.run([sys.executable, "-c", asked], capture_output=True, text=True, check=True).stdout
    slow = {"matplotlib", "scipy.special", "scipy.signal", "scipy.optimize", "jinja2", "nidaqmx", "asyncio"}
    assert "pyqtgraph" in loaded.split() and not slow & set(loaded.split())
