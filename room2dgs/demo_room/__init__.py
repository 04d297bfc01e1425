"""The demo room, part by part: furniture, textures, baked light, camera path, photos, exact mesh."""
