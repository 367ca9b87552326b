"""Comparisons with peers, each in one process with the same threads: `python -m benches`."""
