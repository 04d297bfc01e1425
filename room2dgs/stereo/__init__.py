"""Dense depth from many photos: PatchMatch stereo on the CPU, filtered by agreement between views."""
