"""Output in the terminal and in files: numbers, tables, progress, JSON and Markdown.

Reads results as plain records. Writes to stdout, stderr and marked sections of Markdown pages.
"""
