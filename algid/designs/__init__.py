"""Plan a motion before anything moves: limits in, a trajectory with known error bars out."""
