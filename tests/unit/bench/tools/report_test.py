"""The page of results: what it tells of a recorded run, and that a run that ends early keeps what it
has. The recorded run is made up of few rows: one that is disturbed and misses its target, a peer that
is quicker at the tail, and parts that did not run to their end.
"""

import contextlib
import io
import json
import pathlib
import signal
import subprocess
import sys
import tempfile
import time
import unittest

import tool

# In the place of rtpm-bench: nothing of the paper's parts, then two results at once, and it hangs until
# it is ended.
HANGING_BENCH = """#!/bin/sh
case "$*" in *--latencies*) exit 0 ;; esac
echo '{"case": "call", "transport": "udp", "wait": "adaptive", "payload": 48, "p50_us": 1}'
echo '{"case": "call", "transport": "udp", "wait": "block", "payload": 48, "p50_us": 2}'
echo 'rtpm-bench: two-node: the right CAP_SYS_ADMIN is missing' >&2
exec sleep 60
"""


class Folder(unittest.TestCase):
    """Each test has a folder of its own."""

    def setUp(self):
        held = tempfile.TemporaryDirectory()
        self.addCleanup(held.cleanup)
        self.folder = pathlib.Path(held.name)
        self.page = self.folder / "RESULTS.md"

    def report(self, *arguments, environment=None):
        return tool.run("report", "--folder", self.folder, "--page", self.page, *arguments,
                        environment=environment)

    def text(self):
        return self.page.read_text(encoding="utf-8")


class Page(Folder):
    def setUp(self):
        super().setUp()
        self.end = self.report("--from", tool.data("report.jsonl"))

    def test_has_a_row_for_each_result_with_its_ratio_and_interval(self):
        self.assertRegex(self.text(), r"\n\| udp, adaptive \| 6\.73 \|.*\| 1\.12 \(1\.12–1\.12\) \|")

    def test_has_the_sealed_call_beside_the_plain_one(self):
        self.assertRegex(self.text(), r"\n\| udp, adaptive .*\| 9\.10 \| 1\.14 \(1\.13–1\.15\) \|\n")
        self.assertRegex(self.text(), r"\n\| shm, spin .*\| – \| – \|\n")

    def test_lists_the_missed_target(self):
        self.assertIn("- call, shm, spin, 48 B: ratio_p50 2.50 x the floor, target at most 1.80",
                      self.text())

    def test_lists_where_a_peer_is_quicker_for_sure_and_only_that(self):
        lost = self.text().partition("surely slower in 2:")[2].partition("\n##")[0]
        self.assertIn("- call, other tcp beside RTPM udp: 1.50 (1.20–1.90) × the peer's p99.9", lost)
        self.assertIn("2.00 (1.50–2.20) × the peer's p50 of the last consumer", lost)
        self.assertEqual(lost.count("× the peer's"), 2)

    def test_marks_the_disturbed_row(self):
        self.assertIn("\n| shm, spin † |", self.text())

    def test_says_by_name_what_is_missing(self):
        for line in ("- isolation, udp, spin wait, 48 bytes: a lane that spins would starve",
                     "- `isolation` (isolation --wait spin): incomplete",
                     "- peer absent: it is not built; it takes the package libabsent-dev",
                     "- `large` (large): interrupted", "- `events`: not begun"):
            self.assertIn("\n" + line, self.text())
        self.assertEqual(self.end.code, 1, "not all was measured")

    def test_tells_no_tail_of_too_few_samples(self):
        row = next(line for line in self.text().split("\n") if line.startswith("| shm, spin"))
        self.assertIn("| – |", row, "p99.9 of 400 samples a round")


class BadFile(Folder):
    def test_is_complained_of_in_a_sentence(self):
        self.assertEqual(self.report("--from", "missing.jsonl").one_sentence(self, 2),
                         "report: missing.jsonl cannot be read: No such file or directory")
        with tool.file("{}\n") as path:
            self.assertRegex(self.report("--from", path).one_sentence(self, 2),
                             "line 1: this is no result")
        self.assertFalse(self.page.exists())


class Run(Folder):
    def bench(self, script):
        path = self.folder / "rtpm-bench"
        path.write_text(script, encoding="utf-8")
        path.chmod(0o755)
        return path

    def test_keeps_what_it_has_when_it_is_interrupted(self):
        results = self.folder / "results.jsonl"
        with subprocess.Popen(
                [sys.executable, "-B", tool.TOOLS / "report.py", "--quick", "--bench",
                 self.bench(HANGING_BENCH), "--folder", self.folder, "--page", self.page],
                stderr=subprocess.PIPE, text=True) as process:
            give_up = time.monotonic() + 20
            while time.monotonic() < give_up and not (
                    results.exists() and '"block"' in results.read_text(encoding="utf-8")):
                time.sleep(0.01)
            process.send_signal(signal.SIGINT)
            process.communicate(timeout=20)
        self.assertEqual(process.returncode, 130)
        self.assertIn("| udp, block |", self.text())
        self.assertIn("- `call` (call --wait adaptive,spin --samples 50000): interrupted",
                      self.text())
        self.assertIn("\n- two-node: the right CAP_SYS_ADMIN is missing", self.text())
        self.assertIn("- `throughput` (throughput --samples 100000): interrupted", self.text())

    def test_needs_no_git(self):
        end = self.report("--quick", "--bench", self.bench("#!/bin/sh\nexit 0\n"),
                          environment={"PATH": "/nowhere"})
        self.assertNotIn("Traceback", end.errors)
        self.assertRegex(self.text(), r"\nCommit unknown, \d{4}-\d\d-\d\d, quick run;")


class Budget(unittest.TestCase):
    def test_leaves_out_by_name_what_there_is_no_time_for(self):
        sys.path.insert(0, str(tool.TOOLS))
        import measure  # pylint: disable=import-outside-toplevel,import-error
        import plan  # pylint: disable=import-outside-toplevel,import-error
        parts = (plan.Part("long", "", 100), plan.Part("short", "", 4))
        kept = io.StringIO()
        with contextlib.redirect_stderr(io.StringIO()) as said:
            measure.Measurement("true", kept, 10).run_all(parts)
        outcomes = [(record["part"], record["outcome"])
                    for record in map(json.loads, kept.getvalue().splitlines())]
        self.assertEqual(outcomes, [("long", "out of time"), ("short", "done")])
        self.assertIn("leaving out long: there is no time left for it", said.getvalue())

    def test_is_enough_for_all_parts(self):
        sys.path.insert(0, str(tool.TOOLS))
        import plan  # pylint: disable=import-outside-toplevel,import-error
        self.assertLessEqual(sum(part.seconds for part in plan.FULL), 22 * 60)
        self.assertLessEqual(sum(part.seconds for part in plan.QUICK), 4.5 * 60)


if __name__ == "__main__":
    unittest.main()
