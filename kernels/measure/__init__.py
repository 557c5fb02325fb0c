"""What is added up per grain during the steps: energy and momentum budgets, flow through planes."""
