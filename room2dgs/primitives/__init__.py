"""What a room is made of: the kinds of primitive that are optimised and rendered, all in one registry."""
