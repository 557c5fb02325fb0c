"""Contact between grains: the law that joins the models, and the loops over contacts."""
