//! Parameters, as stations ask for them.

use ipc_types::code::{Reason, Stage};
use ipc_types::payload::RequestReport;
use mavlink_gateway::message::{
    FILE_TRANSFER_PROTOCOL, PARAM_ERROR, PARAM_REQUEST_LIST, PARAM_REQUEST_READ, PARAM_SET,
    PARAM_VALUE,
};
use mavlink_gateway::wire::MessageWriter;
use mavlink_gateway::{Order, OrderKind, Settings};

use crate::common::{QGC, SCRIPT, Sent, Station, World, long, texts};

const REAL: u8 = 9;
const INT: u8 = 6;

fn list(world: &mut World, by: Station) {
    let message = MessageWriter::new(PARAM_REQUEST_LIST).u8(1).u8(0);
    world.receive(by, &by.frame(&message));
}

fn read(world: &mut World, by: Station, index: i16, name: &str) {
    let message = MessageWriter::new(PARAM_REQUEST_READ)
        .i16(index)
        .u8(1)
        .u8(1);
    world.receive(by, &by.frame(&message.text(name, 16)));
}

fn set(world: &mut World, by: Station, name: &str, bits: u32, kind: u8) {
    let message = MessageWriter::new(PARAM_SET).u32(bits).u8(1).u8(1);
    world.receive(by, &by.frame(&message.text(name, 16).u8(kind)));
}

fn reported(world: &mut World, order: &Order, stage: Stage, reason: Reason, value: Option<f64>) {
    let report = RequestReport {
        value: value.unwrap_or(0.0),
        value_valid: u16::from(value.is_some()),
        ..RequestReport::new(stage, reason)
    };
    let words = format!("parameter {stage} ({reason})");
    world
        .gateway
        .report(order.number, &report, &words, world.now);
    world.gateway.advance(world.now);
}

/// The one order that there is.
fn order(world: &mut World) -> Order {
    let orders = world.orders();
    let [order] = orders[..] else {
        panic!("{orders:?}")
    };
    order
}

fn name(sent: &Sent, at: usize) -> String {
    let bytes = sent.bytes::<16>(at);
    let text = std::str::from_utf8(&bytes).expect("ASCII");
    text.trim_end_matches('\0').to_owned()
}

/// PARAM_VALUE: to which port, name, bits, type.
fn values(sent: &[Sent]) -> Vec<(u16, String, u32, u8)> {
    let values = sent.iter().filter(|one| one.kind == PARAM_VALUE);
    let value = |one: &Sent| {
        let bits = u32::from_le_bytes(one.bytes(0));
        (one.to.port(), name(one, 8), bits, one.bytes::<1>(24)[0])
    };
    values.map(value).collect()
}

/// PARAM_ERROR: name and error.
fn errors(sent: &[Sent]) -> Vec<(String, u8)> {
    let errors = sent.iter().filter(|one| one.kind == PARAM_ERROR);
    errors
        .map(|one| (name(one, 4), one.bytes::<1>(20)[0]))
        .collect()
}

#[test]
fn a_list_is_read_from_the_dsp_one_by_one_and_is_whole() {
    let mut world = World::with_station();
    world.heartbeat(SCRIPT);
    world.sent();
    list(&mut world, QGC);
    let own = world.sent();
    let count = u16::from_le_bytes(own[0].bytes(4));
    assert_eq!(values(&own)[0].1, "MIS_TAKEOFF_ALT");
    let mut all = values(&own);
    loop {
        let orders = world.orders();
        let Some(order) = orders.first() else {
            break;
        };
        assert_eq!(orders.len(), 1, "one is read at a time");
        assert!(matches!(order.kind, OrderKind::ReadPort(_)));
        assert_eq!(order.begin_by, None);
        reported(&mut world, order, Stage::Accepted, Reason::None, None);
        assert_eq!(values(&world.sent()), []);
        reported(&mut world, order, Stage::Done, Reason::None, Some(2.0));
        all.extend(values(&world.sent()));
    }
    assert_eq!(all.len(), usize::from(count));
    assert!(all.iter().all(|(port, ..)| *port == QGC.port));
    let of = |name: &str| all.iter().find(|one| one.1 == name).expect("it is there");
    assert_eq!(of("DSP_STATUS_MS").2, 2, "integers are not converted");
    assert_eq!(of("DSP_STATUS_MS").3, INT);
    assert_eq!(of("DSP_CRUISE_MPS").2, 2_f32.to_bits());
    assert_eq!(of("SYS_HAS_MAG").2, 0);
    // By number, of one that is not of the DSP.
    read(&mut world, SCRIPT, 0, "");
    assert_eq!(
        values(&world.sent()),
        [(
            SCRIPT.port,
            "MIS_TAKEOFF_ALT".to_owned(),
            10_f32.to_bits(),
            REAL
        )]
    );
}

#[test]
fn a_value_is_set_once_and_all_stations_get_what_the_dsp_then_has() {
    let mut world = World::with_station();
    world.heartbeat(SCRIPT);
    world.sent();
    let bits = 7.5_f32.to_bits();
    set(&mut world, SCRIPT, "DSP_CRUISE_MPS", bits, REAL);
    set(&mut world, SCRIPT, "DSP_CRUISE_MPS", bits, REAL);
    let write = order(&mut world);
    assert_eq!(write.kind, OrderKind::WritePort(20_000, 7.5));
    assert!(write.begin_by.is_some(), "a late value is not set");
    reported(&mut world, &write, Stage::Accepted, Reason::None, None);
    reported(&mut world, &write, Stage::Done, Reason::None, Some(7.5));
    let name = || "DSP_CRUISE_MPS".to_owned();
    assert_eq!(
        values(&world.sent()),
        [QGC, SCRIPT].map(|station| (station.port, name(), bits, REAL))
    );
    // Of whole numbers, the same bits.
    set(
        &mut world,
        SCRIPT,
        "DSP_TRIM_ROLL_US",
        (-20_i32).cast_unsigned(),
        INT,
    );
    let write = order(&mut world);
    assert_eq!(write.kind, OrderKind::WritePort(10_201, -20.0));
    // The bridge refuses it: the asker gets an error, the reason, and the value that there is.
    reported(
        &mut world,
        &write,
        Stage::Refused,
        Reason::NotInFlight,
        None,
    );
    let sent = world.sent();
    assert_eq!(errors(&sent), [("DSP_TRIM_ROLL_US".to_owned(), 3)]);
    assert_eq!(texts(&sent)[0].1, "parameter refused (not-in-flight)");
    let read = order(&mut world);
    assert_eq!(read.kind, OrderKind::ReadPort(10_201));
    reported(&mut world, &read, Stage::Done, Reason::None, Some(-3.0));
    let value = values(&world.sent());
    assert_eq!((value.len(), value[0].0), (1, SCRIPT.port));
    assert_eq!(value[0].2.cast_signed(), -3);
}

#[test]
fn a_frame_that_comes_late_is_not_written_over_a_newer_one() {
    let mut world = World::with_station();
    let frame = |value: f32, sequence| {
        let message = MessageWriter::new(PARAM_SET).f32(value).u8(1).u8(1);
        let message = message.text("DSP_CRUISE_MPS", 16).u8(REAL);
        message.frame(sequence, QGC.system, 190)
    };
    let write = |world: &mut World, value: f32, sequence| {
        world.receive(QGC, &frame(value, sequence));
        let order = order(world);
        let done = f64::from(value);
        reported(world, &order, Stage::Done, Reason::None, Some(done));
        (order.kind, values(&world.sent())[0].2)
    };
    let written = |value: f32| (OrderKind::WritePort(20_000, value.into()), value.to_bits());
    assert_eq!(write(&mut world, 7.0, 254), written(7.0));
    assert_eq!(write(&mut world, 8.0, 1), written(8.0));
    // A copy of the newest, and of the one before: the station gets what there is.
    for (value, sequence) in [(8.0, 1), (7.0, 254)] {
        world.receive(QGC, &frame(value, sequence));
        let read = order(&mut world);
        assert_eq!(read.kind, OrderKind::ReadPort(20_000));
        reported(&mut world, &read, Stage::Done, Reason::None, Some(8.0));
        assert_eq!(values(&world.sent())[0].2, 8_f32.to_bits());
    }
    // A station that does not count its frames may write a value twice, and so may one that began anew.
    assert_eq!(write(&mut world, 8.0, 2), written(8.0));
    assert_eq!(write(&mut world, 9.0, 2), written(9.0));
    (0..3).for_each(|_| world.tick(1_000));
    world.sent();
    assert_eq!(write(&mut world, 7.0, 0), written(7.0));
}

#[test]
fn the_newest_speed_counts_whether_a_command_or_a_parameter_sets_it() {
    let set = |value: f32, sequence| {
        let message = MessageWriter::new(PARAM_SET).f32(value).u8(1).u8(1);
        let message = message.text("DSP_CRUISE_MPS", 16).u8(REAL);
        message.frame(sequence, QGC.system, 190)
    };
    let change = |mps: f32, sequence| {
        let message = long(178, [1.0, mps, -1.0, 0.0, 0.0, 0.0, 0.0]);
        message.frame(sequence, QGC.system, 190)
    };
    // The parameter was set before, and comes after the command.
    let mut world = World::with_station();
    world.receive(QGC, &change(8.0, 7));
    assert_eq!(order(&mut world).kind, OrderKind::Speed(8.0));
    world.receive(QGC, &set(5.0, 6));
    assert_eq!(order(&mut world).kind, OrderKind::ReadPort(20_000));
    // It waits behind a reading when the command comes.
    let mut world = World::with_station();
    read(&mut world, QGC, -1, "DSP_ROTOR_RPM");
    let reading = order(&mut world);
    world.receive(QGC, &set(5.0, 6));
    assert_eq!(world.orders(), []);
    world.receive(QGC, &change(8.0, 7));
    assert_eq!(order(&mut world).kind, OrderKind::Speed(8.0));
    reported(&mut world, &reading, Stage::Done, Reason::None, Some(1.0));
    let told = order(&mut world);
    assert_eq!(told.kind, OrderKind::ReadPort(20_000));
    reported(&mut world, &told, Stage::Done, Reason::None, Some(8.0));
    let sent = values(&world.sent());
    assert!(sent.iter().any(|value| value.2 == 8_f32.to_bits()));
}

#[test]
fn what_is_refused_here_is_an_error_with_its_reason_and_no_order() {
    let settings = Settings {
        commanders: vec![QGC.system],
        ..Settings::default()
    };
    let mut world = World::new(settings);
    world.heartbeat(QGC);
    world.sent();
    let seven = 7_f32.to_bits();
    let cases = [
        ("NO_SUCH", seven, REAL, 1),
        // Those are the bridge's alone.
        ("take_off", 1, INT, 1),
        ("DSP_CRUISE_MPS", 21_f32.to_bits(), REAL, 2),
        ("DSP_CRUISE_MPS", f32::NAN.to_bits(), REAL, 2),
        ("MIS_TAKEOFF_ALT", 201_f32.to_bits(), REAL, 2),
        ("DSP_ROTOR_RPM", 499, INT, 2),
        ("SYS_AUTOSTART", 0, INT, 5),
        ("DSP_CRUISE_MPS", 7, INT, 7),
        ("DSP_ROTOR_RPM", 1500_f32.to_bits(), REAL, 7),
        ("DSP_ROTOR_RPM", 1500, 4, 7),
    ];
    for (name, bits, kind, error) in cases {
        set(&mut world, QGC, name, bits, kind);
        let sent = world.sent();
        assert_eq!(errors(&sent), [(name.to_owned(), error)], "{name} {bits}");
        // Only the old value is read, for those that read no errors.
        let orders = world.orders();
        assert!(
            orders
                .iter()
                .all(|order| matches!(order.kind, OrderKind::ReadPort(_))),
            "{orders:?}"
        );
        for order in orders {
            reported(&mut world, &order, Stage::Done, Reason::None, Some(5.0));
        }
        world.pass(6_000);
        world.heartbeat(QGC);
        world.sent();
    }
    // A station that may not command reads, and sets nothing.
    world.heartbeat(SCRIPT);
    world.sent();
    set(&mut world, SCRIPT, "MIS_TAKEOFF_ALT", seven, REAL);
    let sent = world.sent();
    assert_eq!(errors(&sent), [("MIS_TAKEOFF_ALT".to_owned(), 3)]);
    assert_eq!(values(&sent)[0].2, 10_f32.to_bits());
    set(&mut world, QGC, "MIS_TAKEOFF_ALT", seven, REAL);
    assert_eq!(values(&world.sent()).len(), 2, "both are told");
    // One that has sent no heartbeat gets nothing but a text, and learns that what it sets is not set.
    let stranger = Station {
        port: 9,
        system: QGC.system,
    };
    list(&mut world, stranger);
    read(&mut world, stranger, 0, "");
    let sent = world.sent();
    assert_eq!((values(&sent).len(), texts(&sent).len()), (0, 1));
    assert_eq!(errors(&sent), []);
    set(&mut world, stranger, "MIS_TAKEOFF_ALT", seven, REAL);
    let sent = world.sent();
    assert_eq!(errors(&sent), [("MIS_TAKEOFF_ALT".to_owned(), 3)]);
    assert!(values(&sent).is_empty());
    assert!(world.orders().is_empty());
}

/// MAVProxy asks for a file with all of them first, and for a list when there is none.
#[test]
fn a_request_for_a_file_is_refused_at_once() {
    let mut world = World::with_station();
    let request = |system: u8, opcode: u8| {
        let message = MessageWriter::new(FILE_TRANSFER_PROTOCOL)
            .u8(0)
            .u8(system)
            .u8(1);
        QGC.frame(&message.u16(8).u8(3).u8(opcode))
    };
    world.receive(QGC, &request(1, 4));
    let sent = world.sent();
    let [nak] = &sent[..] else { panic!("{sent:?}") };
    assert_eq!(nak.bytes::<3>(0), [0, QGC.system, 190]);
    assert_eq!(
        (nak.bytes::<6>(3), nak.bytes::<1>(15)),
        ([9, 0, 3, 129, 1, 4], [7])
    );
    for (system, opcode) in [(2, 4), (1, 128), (1, 129)] {
        world.receive(QGC, &request(system, opcode));
        assert_eq!(world.sent(), []);
    }
}

#[test]
fn a_take_off_without_a_height_climbs_to_the_one_that_was_set() {
    let mut world = World::with_station();
    world.state.blocked = 0;
    world.tick(20);
    let height = 12.5_f32;
    set(&mut world, QGC, "MIS_TAKEOFF_ALT", height.to_bits(), REAL);
    let mut params = [f32::NAN; 7];
    params[1] = 0.0;
    world.command(QGC, 22, params);
    assert_eq!(world.kinds(), [OrderKind::TakeOff(12.5)]);
}

#[test]
fn a_bridge_that_says_nothing_holds_up_no_other_parameter() {
    let mut world = World::with_station();
    read(&mut world, QGC, -1, "DSP_POS_GAIN");
    read(&mut world, QGC, -1, "DSP_YAW_GAIN");
    let first = order(&mut world);
    for _ in 0..10 {
        world.tick(1_000);
    }
    assert_eq!(
        errors(&world.sent()),
        [("DSP_POS_GAIN".to_owned(), 8)],
        "its outcome is not known"
    );
    let second = order(&mut world);
    // What comes late is not the answer to the next one.
    reported(&mut world, &first, Stage::Done, Reason::None, Some(1.0));
    assert_eq!(values(&world.sent()), []);
    reported(&mut world, &second, Stage::Done, Reason::None, Some(1.5));
    assert_eq!(values(&world.sent())[0].1, "DSP_YAW_GAIN");
}
