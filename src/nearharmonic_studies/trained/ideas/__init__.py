"""Best idea over anharmonicity and step size: from the exact oscillator to trained methods."""
