"""The payload in time: when it changed, and what each stretch weighs."""
