"""What accuracy costs the estimator in time, and where more of it stops paying because noise dominates."""
