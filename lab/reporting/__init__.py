"""Output in the terminal and in files: tables, progress, the report of a run, JSON and Markdown.

Reads results as plain records. Writes to stdout, stderr and marked sections of Markdown pages.
"""
