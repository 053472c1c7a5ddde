"""A result as a model that simulators, controllers and planners load: one file a format."""
