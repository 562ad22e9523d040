"""From numba's modules to one library per platform, for machines that compile nothing.

In this order: :mod:`.platforms` names what libraries are built for; :mod:`.objects` turns numba's modules into object
files of a platform; :mod:`.glue` writes the extension module around them, through which Python calls kernels and finds
addresses; :mod:`.linker` makes one file of all.
"""
