"""The notebooks run from top to bottom, as their readers run them, and show what they promise."""

from __future__ import annotations

import base64
import os
import re
from pathlib import Path

import pytest

nbclient = pytest.importorskip("nbclient", reason="the notebooks' tests need nbclient")
nbformat = pytest.importorskip("nbformat", reason="the notebooks' tests need nbformat")
pytest.importorskip("ipykernel", reason="the notebooks' tests need ipykernel")

NOTEBOOKS = Path(__file__).parents[1] / "notebooks"


class Ran:
    """A notebook's outputs."""

    def __init__(self, name: str, folder: Path) -> None:
        notebook = nbformat.read(NOTEBOOKS / f"{name}.ipynb", as_version=4)
        for cell in notebook.cells:
            if cell.cell_type == "code":
                assert cell.outputs == [] and cell.execution_count is None, (
                    "commit it without outputs"
                )
        nbclient.NotebookClient(
            notebook,
            timeout=100,
            kernel_name="python3",
            resources={"metadata": {"path": str(folder)}},
        ).execute()
        outputs = [output for cell in notebook.cells for output in cell.get("outputs", [])]
        for output in outputs:
            if output.get("name") == "stderr":  # A busy host is no error.
                assert "skipped because Python was late" in output["text"], output["text"]
        shown = [output["data"] for output in outputs if "data" in output]
        #: What was printed.
        self.text = "".join(output.get("text", "") for output in outputs)
        self.html: list[str] = [data["text/html"] for data in shown if "text/html" in data]
        self.figures = [
            base64.b64decode(data["image/png"]) for data in shown if "image/png" in data
        ]
        kept = os.environ.get("RTPM_KEEP_PICTURES")
        for number, figure in enumerate(self.figures if kept else []):
            Path(str(kept), f"{name}-{number}.png").write_bytes(figure)
        for number, html in enumerate(self.html if kept else []):
            Path(str(kept), f"{name}-{number}.html").write_text(html)

    def number(self, pattern: str) -> float:
        found = re.search(pattern, self.text)
        assert found, f"{pattern} is not in {self.text}"
        return float(found[1])


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    for variable in ("IPYTHONDIR", "JUPYTER_RUNTIME_DIR", "MPLCONFIGDIR"):
        monkeypatch.setenv(variable, str(tmp_path / variable))
    return tmp_path


def lines_in(html: str) -> list[int]:
    """How many points each line of a live plot has."""
    return [points.count(",") for points in re.findall(r'<polyline points="([^"]*)"', html)]


def test_first_touch(folder: Path) -> None:
    ran = Ran("first_touch", folder)
    tables = [html for html in ran.html if "<table>" in html]
    assert "RTPM simulated arm" in tables[0] and ">N<" in tables[0]
    assert "<b>Sample</b>" in tables[1] and "<b>Vector3</b>" in tables[2]
    (plot,) = (html for html in ran.html if "<svg" in html)
    assert len(lines_in(plot)) == 6 and min(lines_in(plot)) > 50
    assert ran.number(r"'cycles': (\d+)") > 0
    assert ran.number(r"pushed back with up to ([\d.]+) N") > 0.5
    assert ran.number(r"pulled with ([\d.]+) N") > 0
    assert "stiffness_newton_per_m is 9000; choose 0 to 1667" in ran.text
    assert re.search(r"lab/\w+0 ButtonChange\(", ran.text)


def test_staircase(folder: Path) -> None:
    pytest.importorskip("matplotlib")
    ran = Ran("staircase", folder)
    assert len(ran.figures) == 2
    assert re.search(r"450 N/m felt as 4[2-7]\d N/m", ran.text)
    # The simulated subject's own threshold is 8 %; these are some 45 answers that depend on chance.
    assert 8 / 4 < ran.number(r"by the reversals: ([\d.]+) %") < 8 * 4
    assert 0.1 / 3 < ran.number(r"Weber fraction: ([\d.]+)") < 0.1 * 3


def test_recording(folder: Path) -> None:
    pytest.importorskip("matplotlib")
    pytest.importorskip("pandas")
    ran = Ran("recording", folder)
    assert len(ran.figures) == 2
    assert ran.number(r"stiffness: (\d+) N/m") == pytest.approx(400, rel=0.1)
    assert "lab/arm0/sampled" in ran.html[0]
    assert ran.number(r"(\d+) samples") > 4000
