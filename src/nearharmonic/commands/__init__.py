"""The subcommands of ``nearharmonic``, one module each."""
