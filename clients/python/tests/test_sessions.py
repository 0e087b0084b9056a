"""A session is a recording that states its experiment, and the parameters of its devices."""

from __future__ import annotations

from pathlib import Path

import pytest
import rtpm
from conftest import Laboratory


def test_a_session_is_recorded_with_trials_and_parameters(
    laboratory: Laboratory, node: rtpm.Node, tmp_path: Path
) -> None:
    pattern = tmp_path / "{experiment}_{participant}"
    with rtpm.session(
        participant="P07", experiment="touch", condition="soft", path=pattern, node=node
    ) as session:
        with rtpm.trial(1, "soft", node=node) as trial:
            trial.response = "left"
    assert session.path == str(tmp_path / "touch_P07.mcap")
    assert session.lost_count == 0 and session.missing == []
    with rtpm.open(session.path) as recording:
        stated = dict(recording.core.metadata())["rtpm.session"]
        assert (stated["participant"], stated["condition"]) == ("P07", "soft")
        phases = [each.value.phase for each in recording["rtpm.Trial/0"]]
        assert phases == [rtpm.TrialPhase.Begin, rtpm.TrialPhase.End]
        (parameters,) = recording["lab/arm0/parameters"].values()
        names = {each.name: each.value.real for each in parameters.parameters}
        assert names["safety.ramp_s"] == pytest.approx(0.02)


def test_a_second_session_overwrites_no_file(
    laboratory: Laboratory, node: rtpm.Node, tmp_path: Path
) -> None:
    path = tmp_path / "{participant}.mcap"
    with rtpm.session(participant="P07", path=path, topics=["rtpm.Trial"], node=node) as first:
        with rtpm.session(participant="P07", path=path, node=node) as second:
            pass
    assert second.path == str(tmp_path / "P07-2.mcap") != first.path


def test_an_error_shows_in_the_recording(
    laboratory: Laboratory, node: rtpm.Node, tmp_path: Path
) -> None:
    with (
        pytest.raises(RuntimeError),
        rtpm.session(participant="P07", path=tmp_path / "run", node=node) as session,
    ):
        raise RuntimeError
    with rtpm.open(session.path) as recording:
        (remark,) = recording["annotations"].values()
        assert remark == {"text": "ended by RuntimeError"}


def test_what_cant_be_stated_is_refused(
    laboratory: Laboratory, node: rtpm.Node, tmp_path: Path
) -> None:
    with pytest.raises(rtpm.SetupError, match="participant"):
        rtpm.session(participant="P\x1b7", path=tmp_path / "run", node=node)
    with pytest.raises(rtpm.SetupError, match=r"\{condition\}"):
        rtpm.session(path=tmp_path / "{subject}", node=node)
    assert list(tmp_path.iterdir()) == []
