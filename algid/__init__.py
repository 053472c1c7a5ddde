"""algid: parameters and payload of a two-link arm from its torque and angle logs."""

__version__ = "0.1.0"
