from hypermap.experiments.drives import SimulatedDrive, map_drive
from hypermap.mapping import Mapper, profile
from hypermap.simulation import SimulatedRecording, built_in_world, errors_of_level


def test_an_experiment_maps_a_drive_as_a_mapper_does():
    # The map that corrects the poses is bent, so a mapper needs the recorded poses, too.
    world, errors = built_in_world("lab"), errors_of_level("harsh")
    drive = SimulatedDrive(world, 1001, errors, rate=0.25)
    in_experiment = map_drive(drive, {"ours": profile("default")}).objects["ours"]

    recording = SimulatedRecording.with_errors(world, errors, rate=0.25, seed=1001)
    mapper = Mapper(profile("default"), lambda frame: frame.detections, recording.occupancy())
    for frame in recording.frames():
        mapper.add(frame)
    mapped = mapper.hypermap().semantic().objects()

    assert len(mapped) > 5
    assert [_figures(item) for item in in_experiment] == [_figures(item) for item in mapped]


def _figures(item):
    return item.id, item.name, item.footprint.wkb, item.confidence, item.existence
