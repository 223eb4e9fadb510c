"""The Lie algebra of kicks and drifts: brackets, what vanishes, and order conditions."""
