"""What accuracy costs in time: formulations, integrators and step sizes on the benchmark mechanisms, beside other engines."""
