"""The torque's terms, their parameters, and the one form from which everything derives."""
