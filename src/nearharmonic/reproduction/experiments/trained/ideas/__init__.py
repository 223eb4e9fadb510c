"""Which idea is best where, over anharmonicity and step size: from the exact oscillator to trained methods."""
