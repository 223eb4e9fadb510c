"""Machine code: numba types for reals, operations in LLVM, linking, and the on-disk cache of compiled code."""
