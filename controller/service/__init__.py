"""The process of ``directrix serve``: parent of tick and plan, and the far side of the door."""
