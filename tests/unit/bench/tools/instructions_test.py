"""The gate of instruction counts: what moved by how much, and what it says where it cannot tell.

Stands in for rtpm-instructions and valgrind: the program tells its key and names, and valgrind writes
what callgrind would, several times 200 runs of each function, of which the median counts.
"""

import pathlib
import shutil
import tempfile
import unittest

import tool

PROGRAM = """#!/bin/sh
case $1 in
  --key) echo GCC-99-test-Release ;;
  --list) printf 'counted_encode\\ncounted_decode\\n' ;;
esac
"""

VALGRIND = """#!/bin/sh
for argument; do case $argument in --callgrind-out-file=*) out=${argument#*=} ;; esac; done
part() { printf 'part: %s\\ndesc: Trigger: %s\\nsummary: %s\\n' "$1" "$2" "$3" >"$out.$1"; }
part 1 --dump-before=counted_encode 77
part 2 --dump-after=counted_encode 999999
part 3 --dump-after=counted_decode 4000
part 4 --dump-after=counted_encode ENCODE
part 5 --dump-after=counted_encode 8000
"""


class Instructions(unittest.TestCase):
    def setUp(self):
        held = tempfile.TemporaryDirectory()
        self.addCleanup(held.cleanup)
        self.folder = pathlib.Path(held.name)
        self.table = self.folder / "tables" / "GCC-99-test-Release.txt"
        self.program = self.script("rtpm-instructions", PROGRAM)
        self.script("valgrind", VALGRIND.replace("ENCODE", "10000"))
        # What the scripts themselves call is to be found, and no other valgrind.
        self.environment = {"PATH": f"{self.folder}:{pathlib.Path(shutil.which('sh')).parent}"}

    def script(self, name, text):
        path = self.folder / name
        path.write_text(text, encoding="utf-8")
        path.chmod(0o755)
        return path

    def count(self, *arguments):
        return tool.run("instructions", "--program", self.program, "--tables", self.table.parent,
                        *arguments, environment=self.environment)

    def test_says_when_there_is_no_table_for_the_compiler(self):
        end = self.count()
        self.assertEqual(end.code, 0, end.errors)
        self.assertIn("There is no table for GCC-99-test-Release, so nothing is compared", end.output)
        self.assertRegex(end.output, r"encode +50\.0\n")
        self.assertFalse(self.table.exists())

    def test_finds_no_fault_with_what_it_just_kept(self):
        self.assertEqual(self.count("--update").code, 0)
        end = self.count()
        self.assertEqual(end.code, 0, end.errors)
        self.assertIn("All are within 3 %", end.output)

    def test_names_what_moved_and_by_how_much(self):
        self.count("--update")
        self.script("valgrind", VALGRIND.replace("ENCODE", "10400"))
        end = self.count()
        self.assertEqual(end.code, 1)
        self.assertRegex(end.output, r"encode +50\.0 +52\.0 +\+4\.0 %  MOVED")
        self.assertNotRegex(end.output, r"decode.*MOVED")

    def test_lets_pass_what_moved_by_less_than_three_percent(self):
        self.count("--update")
        self.script("valgrind", VALGRIND.replace("ENCODE", "10280"))
        self.assertEqual(self.count().code, 0)

    def test_names_a_function_that_only_one_of_the_two_has(self):
        self.count("--update")
        self.table.write_text(self.table.read_text().replace("decode", "former"))
        end = self.count()
        self.assertEqual(end.code, 1)
        self.assertIn("decode: only in the program", end.output)
        self.assertIn("former: only in the table", end.output)

    def test_says_in_a_sentence_what_is_wrong(self):
        self.table.parent.mkdir()
        self.table.write_text("encode fifty\n")
        self.assertIn("line 1: this is no name and count: encode fifty",
                      self.count().one_sentence(self, 2))
        self.environment = {"PATH": "/nowhere"}
        self.assertEqual(self.count().one_sentence(self, 2),
                         "instructions: counting takes valgrind (Debian's package valgrind)")


if __name__ == "__main__":
    unittest.main()
