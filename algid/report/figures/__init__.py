"""The report's figures: one file each, each made of panels that plotly draws."""
