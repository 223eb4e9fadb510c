"""Elementary functions for kernels: sin, cos, tan, exp, log, cbrt, pow, atan2, tanh, sinh, cosh, erf and hypot."""
