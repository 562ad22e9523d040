"""Shared parts of all commands: the click group, options, choices, errors, loading of scenes and files.

Reads a command's arguments. Returns worlds, settings and plugins, or reports errors in one line. The commands ``plan``
and ``warm-up`` are here too; each study has its command in its own folder.
"""
