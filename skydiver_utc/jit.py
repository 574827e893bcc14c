"""How every kernel is compiled.

Contraction, reassociation and unsigned zeros let the loops over the segments become vector code; NaN and
infinity keep their meaning, so that checks for them work. Every process compiles from the same source with the
same flags, and the results are cached on disk.
"""

from numba import njit

kernel = njit(cache=True, fastmath={"contract", "reassoc", "nsz"}, error_model="numpy")
