"""The comparison of two runs: what it calls a difference, what not, and what it says of bad files.

The three recorded runs: `same` is `first` with every round moved by half a percent at most, and
`slower` besides has RTPM over UDP 20 % slower.
"""

import unittest

import tool


class Compare(unittest.TestCase):
    def test_names_what_became_slower_and_nothing_else(self):
        end = tool.run("compare", tool.data("first.jsonl"), tool.data("slower.jsonl"))
        self.assertEqual(end.code, 0, end.errors)
        sure = [line for line in end.output.split("\n") if line.endswith("DIFFERS")]
        self.assertEqual({line.split()[0] for line in sure},
                         {"p50_us", "p99_us", "p999_us", "ratio_p50", "ratio_p99", "ratio_p999"})
        self.assertIn("6 of 18 figures differ beyond noise:", end.output)
        self.assertRegex(end.output, r"\+(19|20)\.\d %  p50_us of call, udp, adaptive, 48 B")
        self.assertIn("2 of 3 ratios agree at the median within 10 %, but not:", end.output)
        self.assertRegex(end.output.strip().split("\n")[-1],
                         r"^ +\+\d+\.\d %  call, udp, adaptive, 48 B: 1\.12 / 1\.35$")

    def test_finds_no_difference_between_a_run_and_its_like(self):
        end = tool.run("compare", tool.data("first.jsonl"), tool.data("same.jsonl"))
        self.assertEqual(end.code, 0, end.errors)
        self.assertIn("0 of 18 figures differ beyond noise; no difference is proven.", end.output)
        self.assertIn("3 of 3 ratios agree at the median within 10 %.", end.output)

    def test_says_the_same_of_the_same_files(self):
        files = tool.data("first.jsonl"), tool.data("slower.jsonl")
        self.assertEqual(tool.run("compare", *files), tool.run("compare", *files))

    def test_names_rows_of_one_run_only_and_another_machine(self):
        lines = tool.data("first.jsonl").read_text().splitlines()
        other = lines[0].replace('"cpu_count": 2', '"cpu_count": 64')
        with tool.file(other) as path:
            end = tool.run("compare", tool.data("first.jsonl"), path)
        self.assertIn("only in A: call, tcp, adaptive, 48 B", end.output)
        self.assertIn("cpu_count: 2 / 64", end.output)

    def test_says_in_a_sentence_what_is_wrong_with_a_file(self):
        first = tool.data("first.jsonl")
        self.assertEqual(tool.run("compare", first, "missing.jsonl").one_sentence(self, 2),
                         "compare: missing.jsonl cannot be read: No such file or directory")
        with tool.file('{"case": "call"}\nnot at all\n{"case": "call"}') as path:
            text = tool.run("compare", first, path).one_sentence(self, 2)
        self.assertRegex(text, r"line 2: this is no JSON: ")
        with tool.file('{"transport": "udp"}') as path:
            text = tool.run("compare", path, first).one_sentence(self, 2)
        self.assertRegex(text, r'line 1: this is no result: it has no field "case"')
        with tool.file('{"case": "startup"}') as path:
            text = tool.run("compare", first, path).one_sentence(self, 2)
        self.assertRegex(text, r"no figure in common")

    def test_leaves_out_the_line_that_an_interrupted_run_did_not_finish(self):
        whole = tool.data("first.jsonl").read_text()
        with tool.file(whole[:-200]) as path:
            end = tool.run("compare", tool.data("first.jsonl"), path)
        self.assertEqual(end.code, 0, end.errors)
        self.assertIn("only in A: call, shm, adaptive, 48 B", end.output)


if __name__ == "__main__":
    unittest.main()
