"""The fleet's history: parameters over time, drift, payloads against their labels, outliers."""
