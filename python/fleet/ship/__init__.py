"""From the ground to the drones over Zenoh: sessions, clocks, acknowledged messages, shipping a plan."""
