"""A short run of soak.py."""

from soak import soak


def test_memory_does_not_grow():
    figures = soak(seconds=10, warm_up_s=5)
    assert figures["poses_per_s"] > 0
    assert figures["rss_growth_kib"] < 2048, figures
