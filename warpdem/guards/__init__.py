"""What watches a run: each guard notices one way in which a result becomes worthless, and names grain, place and time."""
