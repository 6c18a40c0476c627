"""Mission planning and ground station for fleets of inspection drones."""
