"""What is read off a run: contacts, energies, loads, flows, mixing, averages."""
