"""The benchmarks, one per file: pymunk, features, collision modes, plugin pairs, queries, scaling, startup.

Each reads scenes and the clock, and returns records of :mod:`carom.lab.bench.results` or tables of its own.
"""
