"""What peers need is said where it is installed, where each is built, and where people read it."""

import re
import unittest

import tool

ROOT = tool.TOOLS.parents[1]


def text_of(path):
    """A file of the source tree."""
    return (ROOT / path).read_text(encoding="utf-8")


def packages_by_peer():
    """As rtpm-bench tells them to whoever lacks a peer."""
    entries = re.findall(r'PeerEntry\{"(\w+)",\s*"([^"]+)"', text_of("bench/runs/peers.cpp"))
    return {name: packages.split() for name, packages in entries}


class PeerPackages(unittest.TestCase):
    """Every package that rtpm-bench names for a peer."""

    def test_are_found(self):
        self.assertGreaterEqual(len(packages_by_peer()), 9)

    def test_are_installed_by_the_front_door(self):
        installed = re.search(r"^peer_packages=\(([^)]*)\)", text_of("dev"), re.MULTILINE)
        for name, packages in packages_by_peer().items():
            self.assertLessEqual(set(packages), set(installed[1].split()), name)

    def test_are_those_that_the_build_asks_for(self):
        built = dict(re.findall(r'rtpm_peer\(NAME (\w+) PACKAGES "([^"]+)"',
                                text_of("bench/peers/CMakeLists.txt")))
        for name, packages in packages_by_peer().items():
            self.assertEqual(packages, built[name].split(), name)


if __name__ == "__main__":
    unittest.main()
