"""The micromanipulator, as measured: studied, traced and drawn."""
