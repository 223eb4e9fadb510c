"""The oscillator of the Henon-Heiles system solved exactly, beside the split into T and V."""
