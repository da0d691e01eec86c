"""Mechanisms of the evidence, by physics family; importing the package registers their kinds."""

from afm_scan_bench.mechanisms.sizes import ALL, PAIRS, sized

__all__ = ["ALL", "PAIRS", "sized"]
