"""The bench: simulated devices, the virtual bus that they are on, and ways onto it for others."""
