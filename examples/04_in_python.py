"""Use a map as Python has it: prints it, changes it, makes a table of it, and writes plot.png.

    python examples/04_in_python.py [MAP]

Without MAP, the true map of the simulated room is taken.
"""

import copy
import sys

import shapely
from matplotlib.figure import Figure

from hypermap import SemanticLayer, SemanticObject, open_map, to_geodataframe
from hypermap.simulation import demo_world, ground_truth

room = open_map(sys.argv[1]) if len(sys.argv) > 1 else ground_truth(demo_world())
print(room)

# A layer of a known kind, so that editors and type checkers know what it offers.
things: SemanticLayer = room.semantic()
print(f"\n{len(things)} things, the first of them {next(iter(things))}")

draft = copy.deepcopy(room)
mug = draft.semantic().add(SemanticObject("mug", shapely.Point(1.0, 4.5).buffer(0.05)))
draft.semantic().rename(mug, "cup")
print(f"a cup more in the draft: {draft.semantic()[mug]}")
print("at its place:", draft.label_at("semantic", shapely.Point(1.0, 4.5))[0])

for seat in room.objects(["chair", "sofa"], near="table", within=1.0):
    print(f"{seat.distance:.2f} m from a table: {seat.object}")

table = to_geodataframe(draft)
print(table.groupby("name").size().to_string())

figure = Figure(figsize=(9, 6))
axes = draft.plot(figure.add_subplot(), legend=True)
axes.plot([0.5, 2.0, 3.0], [2.5, 1.2, 1.2], color="black", label="a drive")
figure.savefig("plot.png")
draft.save("draft.hmap")
print("wrote plot.png and draft.hmap")
