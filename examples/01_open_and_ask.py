"""Open a map and ask it: prints what stands at a point, all chairs, and the nearest cup.

    python examples/01_open_and_ask.py [MAP]

Without MAP, the true map of the simulated room is asked.
"""

import sys

import shapely

from hypermap import open_map
from hypermap.simulation import demo_world, ground_truth

room = open_map(sys.argv[1]) if len(sys.argv) > 1 else ground_truth(demo_world())

print("layers:", ", ".join(f"{layer.name} ({layer.class_name})" for layer in room.layers))

here = [1.5, 4.6]
for layer in room.layers:
    print(f"{layer.name} at {here}: {room.label_at(layer.name, here)[0]}")

print("\nall chairs:")
for x, y in room.find("semantic", "chair"):
    print(f"  at ({x:.2f}, {y:.2f})")

corner = shapely.box(0, 3, 3, 5)
names = sorted(set(room.labels_in("semantic", corner).values))
print(f"\nin the upper left corner: {', '.join(names)}")

for cup in room.nearest("cup", [6.0, 4.0], k=1):
    print(f"\nthe cup nearest to the sink is {cup.distance:.2f} m from (6, 4)")
for chair in room.objects("chair", near="table", within=0.3):
    print(f"a chair {chair.distance:.2f} m from a table: object {chair.object.id}")
