"""The World that users hold: entities, events, contacts, queries, casts and snapshots, each in a file of its own.

Reads and writes entities and components through esper and the table. Calls the pipeline for each step, and hands the
results (contacts, hits, stats) out as plain values. Systems get at the world through its services.
"""
