"""From one RGB-D frame to the objects in it: detect, segment, project to the floor."""
