"""Records: blocks of memory that Python and kernels see under the same names.

``schema`` declares them, ``record`` is what Python holds, ``record_type`` what modules of kernels name, ``record_code``
what compiled code makes of it, ``plain_view`` what kernels get without the compiler.
"""
