"""What is kept between runs: whole or not at all, and for other versions of the software for a while."""

import os
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

import evenlight
from evenlight.stimuli.scenes.engine.array_cache import (
    OLD,
    cache_folder,
    cached_array,
    light_sources,
    one_at_a_time,
    store_array,
)

ROOT = Path(evenlight.__file__).parents[1]


@pytest.fixture(autouse=True)
def own_cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))


def names() -> list[str]:
    return sorted(path.name for path in cache_folder().iterdir())


def test_what_was_kept_comes_back_and_a_broken_file_is_as_none() -> None:
    store_array("light-a", np.arange(5), "light-*")
    np.testing.assert_array_equal(cached_array("light-a"), np.arange(5))
    (cache_folder() / "light-a.npy").write_bytes(b"torn")
    assert cached_array("light-a") is None
    assert cached_array("light-b") is None


def test_another_versions_array_stays_until_it_is_old() -> None:
    store_array("light-theirs", np.arange(3), "light-*")
    store_array("light-ours", np.arange(4), "light-*")
    assert names() == ["light-ours.npy", "light-theirs.npy"]
    past = time.time() - OLD - 1
    os.utime(cache_folder() / "light-theirs.npy", (past, past))
    store_array("light-ours", np.arange(4), "light-*")
    assert names() == ["light-ours.npy"]


def test_a_second_process_waits_until_the_first_has_made_it_and_then_finds_it() -> None:
    """The first holds the lock until it is told; the second is started meanwhile and must not make it too."""
    source = (
        "import sys; import numpy as np\n"
        "from evenlight.stimuli.scenes.engine.array_cache import cached_array, store_array, one_at_a_time\n"
        "print('asks', flush=True)\n"
        "with one_at_a_time('light'):\n"
        "    print('found' if cached_array('light-a') is not None else 'makes', flush=True)\n"
    )
    with one_at_a_time("light"):
        second = subprocess.Popen([sys.executable, "-c", source], cwd=ROOT, stdout=subprocess.PIPE, text=True)
        assert second.stdout is not None
        assert second.stdout.readline() == "asks\n"
        store_array("light-a", np.arange(5), "light-*")
    out, _ = second.communicate(timeout=200)
    assert out == "found\n"


def test_an_interrupted_writing_leaves_what_was_there(monkeypatch: pytest.MonkeyPatch) -> None:
    def interrupted(*_: object) -> None:
        raise KeyboardInterrupt

    store_array("light-a", np.arange(5), "light-*")
    monkeypatch.setattr("os.fsync", interrupted)
    for name in ("light-a", "light-b"):
        with pytest.raises(KeyboardInterrupt):
            store_array(name, np.arange(6), "light-*")
    assert names() == ["light-a.npy"]
    np.testing.assert_array_equal(cached_array("light-a"), np.arange(5))


def test_a_folder_that_cannot_be_written_to_is_no_failure(tmp_path: Path) -> None:
    (tmp_path / "cache").write_text("a file where the folder would be")
    with one_at_a_time("light"):
        pass
    store_array("light-a", np.arange(5), "light-*")
    assert cached_array("light-a") is None


def test_light_is_valid_for_the_sources_that_compute_it_and_no_others() -> None:
    """A change of a texture or of a room does not bake the light again; what it reads is in its key."""
    names = {path.name for path in light_sources()}
    assert names == {
        "__init__.py",
        "bake.py",
        "bake_kernels.py",
        "bake_lights.py",
        "ray_tree.py",
        "stitches.py",
    }
