"""A laboratory on a virtual screen, for sessions that are seen, killed and resumed."""

import dataclasses
from pathlib import Path

import pytest
from laboratories import Laboratory

from evenlight.data_schema.storage.text_files import write_toml_record
from evenlight.hardware.rig_files import load_rig


@pytest.fixture(scope="session")
def laboratory() -> type[Laboratory]:
    """Make a laboratory of a folder, a task, a design, a DISPLAY and more options of `run`."""
    return Laboratory


@pytest.fixture(scope="session")
def small_rig(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A window as small as pages find room on, which a processor draws soon, at half the usual refreshes."""
    rig = dataclasses.replace(load_rig("simulated")[0], window_size=(480, 300), refresh_rate=30.0)
    path = tmp_path_factory.mktemp("rig") / "small.rig.toml"
    write_toml_record(path, rig)
    return path
