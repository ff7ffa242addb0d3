"""The trust manager as a service: one admission, two journals, and two wires, DDS and HTTP."""
