"""From a video or a folder of photos to a capture with poses, points and metres."""
