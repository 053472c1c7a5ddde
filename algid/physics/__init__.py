"""What the torque is made of: its terms, their parameters, and the one form that everything derives from."""
