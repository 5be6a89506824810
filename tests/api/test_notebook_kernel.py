"""What a notebook shows while it works, in a kernel as its user has one."""

import re
from collections.abc import Callable, Iterator
from typing import Any

import pytest


@pytest.fixture(scope="module")
def cell(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Callable[[str], list[tuple[str, str, str]]]]:
    """Run a cell, and return what it shows: kind of message, its place, its page."""
    manager = pytest.importorskip("jupyter_client.manager", reason="nbclient is not installed: make test")
    with pytest.MonkeyPatch.context() as patch:
        for name in ("IPYTHONDIR", "JUPYTER_RUNTIME_DIR", "JUPYTER_CONFIG_DIR"):
            patch.setenv(name, str(tmp_path_factory.mktemp(name)))
        with manager.run_kernel(kernel_name="python3", cwd=tmp_path_factory.mktemp("kernel")) as client:

            def run(code: str) -> list[tuple[str, str, str]]:
                said: list[dict[str, Any]] = []
                ended = client.execute_interactive(code, output_hook=said.append, timeout=300)
                assert ended["content"]["status"] == "ok", ended["content"].get("evalue")
                return [
                    (one["msg_type"], shown["transient"]["display_id"], shown["data"]["text/html"])
                    for one in said
                    if "transient" in (shown := one["content"])
                ]

            run("import evenlight\nfrom evenlight import progress, samples")
            yield run


def test_progress_is_one_line_under_the_cell_that_is_written_anew_and_goes(cell) -> None:
    shown = cell(
        "with progress.shown_progress(quiet=True, words='analysing <a>', total=4) as work:\n"
        "    for done in (1, 2):\n"
        "        work.at(done)\n"
        "        work.tell_if_due(since=-10.0)\n"
    )
    kinds, places, pages = zip(*shown, strict=True)
    assert (kinds[0], set(kinds[1:]), len(set(places))) == ("display_data", {"update_display_data"}, 1)
    told = next(page for page in pages if "1 of 4" in page)
    assert re.fullmatch('<progress value="1" max="4"></progress> .* analysing &lt;a&gt;, 1 of 4', told)
    assert any("2 of 4" in page for page in pages)
    assert pages[-1] == ""


def test_calls_of_python_tell_how_far_they_are_unless_they_shall_not(cell) -> None:
    cell(
        "clip = samples.clip(); progress.IN_NOTEBOOKS = 0.0"
    )  # else those of less than a second tell nothing
    calls = {
        "track = evenlight.optimize(clip, budget=0.5)": ("analysing clip, 0 of 75", "optimizing clip"),
        "track.apply(clip, 'dimmed.mkv')": ("dimming clip, 0 of 75",),
        "curves = evenlight.loss_curves(clip)": ("analysing clip, 0 of 75",),
        "fit = evenlight.fit_ramps(samples.ramps())": ("fitting thresholds and curve",),
        "found = evenlight.analyze(samples.ratings())": ("analysing rating",),
    }
    for call, told in calls.items():
        pages = "".join(page for *_, page in cell(call))
        assert all(words in pages for words in told), (call, pages)
    cell("progress.in_notebooks = False")
    assert cell("evenlight.analyze(samples.ratings())") == []
