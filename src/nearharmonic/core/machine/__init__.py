"""Machine code: types of numba for reals, operations in LLVM, linking, and compiled code kept on disk."""
