"""From one RGB-D frame to the objects in it: detect, cut out, project to the floor."""
