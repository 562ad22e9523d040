"""What all commands of the command line share: the click group, options, choices, errors, loading of scenes and files.

Reads the arguments of a command. Hands out worlds, settings and plugins, or says in one line what is wrong. The
commands ``plan`` and ``warm-up`` are here too; each study has its command in its own folder.
"""
