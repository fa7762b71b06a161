use ipc_types::RobotId;
use ipc_types::code::OutlineKind;
use ipc_types::payload::{HeroGeodetic, HeroLocal, SharedStruct};
use operator::robot::geo::moved;
use recording::{Anchor, FlightInfo, Settings, read};
use ros_messages::cdr::Reader;

use super::*;

/// Where `map` begins.
fn home() -> Place {
    Place::new(48.0, 11.0).unwrap()
}

/// Telemetry of a moment and a place: metres east and north of `origin`.
fn sample(origin: Place, ms: u64, east_m: f64, north_m: f64) -> HeroTelemetry {
    let place = moved(origin, east_m, north_m).unwrap();
    let groups = [TelemetryGroup::Xy, TelemetryGroup::Geographic];
    HeroTelemetry {
        received_ns: ms * 1_000_000,
        valid_groups: groups.iter().map(|group| u32::from(group.bit())).sum(),
        geodetic: HeroGeodetic {
            latitude_rad: place.latitude_deg.to_radians(),
            longitude_rad: place.longitude_deg.to_radians(),
            altitude_m: 20.0,
        },
        local: HeroLocal { east_m, north_m },
        ..HeroTelemetry::ZERO
    }
}

/// The outline of this number, of one piece or two, with a path to these places.
fn outline(number: u64, path: &[(f64, f64)]) -> Vec<BridgeOutline> {
    let pieces = 1 + u32::from(!path.is_empty());
    let count = path.len() as u32;
    let fence = BridgeOutline {
        number,
        pieces,
        kind: OutlineKind::Fence.code(),
        total: count,
        ..BridgeOutline::default()
    };
    let mut line = BridgeOutline {
        piece: 1,
        kind: OutlineKind::Path.code(),
        count,
        ..fence
    };
    for (point, (east_m, north_m)) in line.points.iter_mut().zip(path) {
        let place = moved(home(), *east_m, *north_m).unwrap();
        point.latitude_deg = place.latitude_deg;
        point.longitude_deg = place.longitude_deg;
        point.altitude_m = 30.0;
    }
    [fence, line].into_iter().take(pieces as usize).collect()
}

/// What is recorded, with times that are those of samples.
struct World {
    recorder: Recorder,
    paths: Paths,
    now: MonotonicNs,
}

impl World {
    fn new() -> World {
        let info = FlightInfo {
            robot: RobotId::DEFAULT,
            metadata: vec![],
            attachments: vec![],
        };
        let anchor = Anchor {
            monotonic: MonotonicNs(0),
            unix_ns: 0,
        };
        World {
            recorder: Recorder::new(Settings::default(), info, anchor),
            paths: Paths::new(RobotId::DEFAULT, UnixOffset(0)),
            now: MonotonicNs(0),
        }
    }

    fn flies(&mut self, sample: &HeroTelemetry) {
        self.now = sample.received();
        self.paths.telemetry(&mut self.recorder, sample, self.now);
    }

    fn holds(&mut self, pieces: &[BridgeOutline]) {
        for piece in pieces {
            self.paths.outline(&mut self.recorder, piece, self.now);
        }
    }

    /// The lines that were said, by topic: each as its places in whole centimetres.
    fn said(mut self) -> [Vec<Vec<[i64; 3]>>; 2] {
        self.recorder.end(self.now);
        let mut file = Vec::new();
        while let Some(action) = self.recorder.next() {
            action.apply_to(&mut file);
            self.recorder.done(self.now, Ok(()));
        }
        ["planned_path", "flown_path"].map(|name| {
            let messages = read::messages(&file).map(Result::unwrap);
            let of_topic =
                messages.filter(|message| message.topic() == topic(RobotId::DEFAULT, name));
            of_topic.map(|message| places(message.data())).collect()
        })
    }
}

fn places(message: &[u8]) -> Vec<[i64; 3]> {
    let mut reader = Reader::new(message).unwrap();
    let _header = (reader.i32(), reader.u32(), reader.string());
    let count = reader.u32().unwrap();
    let mut place = || {
        let _header = (reader.i32(), reader.u32(), reader.string());
        let numbers: [f64; 7] = std::array::from_fn(|_| reader.f64().unwrap());
        std::array::from_fn(|axis| (numbers[axis] * 100.0).round() as i64)
    };
    (0..count).map(|_| place()).collect()
}

#[test]
fn a_plan_lies_where_telemetry_has_its_places_and_is_said_when_it_changes() {
    let mut world = World::new();
    world.holds(&outline(1, &[]));
    world.holds(&outline(2, &[(300.0, -400.0), (0.0, 50.0)]));
    // Where `map` begins becomes known with the first position.
    for ms in [20, 40, 60] {
        world.flies(&sample(home(), ms, 10.0, 5.0));
    }
    // The fence is another one, or the same comes again.
    world.holds(&outline(3, &[(300.0, -400.0), (0.0, 50.0)]));
    world.holds(&outline(3, &[(300.0, -400.0), (0.0, 50.0)]));
    world.holds(&outline(4, &[(0.0, 50.0)]));
    world.holds(&outline(5, &[]));
    let [planned, _] = world.said();
    assert_eq!(
        planned,
        [
            vec![[30_000, -40_000, 3_000], [0, 5_000, 3_000]],
            vec![[0, 5_000, 3_000]],
            vec![],
        ]
    );
}

#[test]
fn each_file_has_the_plan_and_the_track() {
    let mut world = World::new();
    world.holds(&outline(1, &[(0.0, 50.0)]));
    world.flies(&sample(home(), 20, 0.0, 0.0));
    world.paths.begin_file();
    world.flies(&sample(home(), 40, 0.0, 0.0));
    let [planned, flown] = world.said();
    assert_eq!(planned, [[[0, 5_000, 3_000]], [[0, 5_000, 3_000]]]);
    assert_eq!(flown, [[[0, 0, 2_000]], [[0, 0, 2_000]]]);
}

#[test]
fn a_track_is_said_every_ten_seconds_and_at_the_end_while_it_grows() {
    let mut world = World::new();
    for second in 0..35_u32 {
        let flown_s = f64::from(second.min(22));
        world.flies(&sample(home(), u64::from(second) * 1000, flown_s, 0.0));
    }
    world.paths.end(&mut world.recorder, world.now);
    world.paths.end(&mut world.recorder, world.now);
    let [_, flown] = world.said();
    let lengths: Vec<usize> = flown.iter().map(Vec::len).collect();
    assert_eq!(lengths, [1, 11, 21, 23], "{flown:?}");
    assert_eq!(flown[3][22], [2_200, 0, 2_000]);
}

#[test]
fn a_dsp_that_begins_again_elsewhere_begins_another_map() {
    let mut world = World::new();
    world.holds(&outline(1, &[(0.0, 50.0)]));
    world.flies(&sample(home(), 0, 0.0, 0.0));
    world.flies(&sample(home(), 1000, 2.0, 0.0));
    // What the flat map is off by is no other origin.
    let far = sample(home(), 2000, 4000.0, 0.0);
    let local = HeroLocal {
        east_m: 4020.0,
        north_m: 0.0,
    };
    world.flies(&HeroTelemetry { local, ..far });
    let elsewhere = moved(home(), 0.0, 20.0).unwrap();
    world.flies(&sample(elsewhere, 12_000, 0.0, 0.0));
    let [planned, flown] = world.said();
    assert_eq!(planned, [[[0, 5_000, 3_000]], [[0, 3_000, 3_000]]]);
    assert_eq!(flown, [[[0, 0, 2_000]], [[0, 0, 2_000]]]);
}

#[test]
fn without_a_position_nothing_is_said() {
    let mut world = World::new();
    world.holds(&outline(1, &[(0.0, 50.0)]));
    let groups = TelemetryGroup::Geographic.bit().into();
    world.flies(&HeroTelemetry {
        valid_groups: groups,
        ..sample(home(), 0, 0.0, 0.0)
    });
    world.paths.end(&mut world.recorder, world.now);
    assert_eq!(world.said(), [vec![], vec![]] as [Vec<Vec<[i64; 3]>>; 2]);
}
