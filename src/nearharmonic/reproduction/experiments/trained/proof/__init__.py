"""The proof: all methods on problems that no method was trained on, and by how much trained methods are ahead."""
