"""warpdem: discrete element method for granular flow in rotating and moving equipment."""
