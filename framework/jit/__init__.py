"""Compiled code: the disk cache of kernels, the hash that names its files, and arrays on the stack of a kernel.

Reads byte code, constants and captured values of kernels. Writes one file per kernel and signature into the cache
folder. ``compilation.py``, one folder up, has the decorators.
"""
