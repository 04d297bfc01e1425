"""What a phone does to photos, so that tests, measurements and networks meet it: each effect by name, and seeded."""
