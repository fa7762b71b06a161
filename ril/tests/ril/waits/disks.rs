//! A disk that is held up: by three seconds each call about what a process writes and keeps, file by file. The robot's
//! telemetry, that of a station and that of a page go on, orders are acknowledged, and the process ends.

use std::fs::{self, Permissions};
use std::net::UdpSocket;
use std::os::unix::fs::PermissionsExt;
use std::path::PathBuf;
use std::time::{Duration, Instant, SystemTime};

use endurance::mavlink::mission::{mission, upload, upload_until};
use endurance::mavlink::station::{Received, Station, heartbeat, long};
use ipc_types::MonotonicNs;
use mavlink_gateway::message::{
    COMMAND_ACK, GLOBAL_POSITION_INT, MISSION_ACK, MISSION_COUNT, MISSION_ITEM_INT,
    MISSION_REQUEST_INT, MISSION_SET_CURRENT,
};
use mavlink_gateway::wire::MessageWriter;
use mavlink_gateway::{Mission, Signing, SigningKey};
use ril_tests::pace::{self, ACKNOWLEDGED, ENDED, GAP, Pace, gaps, judge};
use ril_tests::process::{Signal, WAIT_LIMIT};
use ril_tests::sandbox::free_port;
use ril_tests::{Process, Sandbox};

use super::held_up::{HeldUp, Rig, ends};
use super::{has_strace, of_page, of_station};
use crate::view::{page::Page, token};

/// What a disk does for what a process writes, and for what it keeps.
const WRITES: &str = "write,pwrite64,fsync,fdatasync,ftruncate";
const KEEPS: &str = "openat,write,fsync,fdatasync,rename,mkdir,statx,flock,readlink";

/// Items of a mission that a station uploads.
const UPLOADED: u16 = 3;

/// MAV_MISSION_TYPE.
const FENCE: u8 = 1;

const PASSPHRASE: &str = "correct horse battery";

/// A process whose disk is held up.
struct DiskRow {
    what: &'static str,
    args: &'static str,
    /// What it says when its files are there.
    begun: &'static str,
    calls: &'static str,
    /// Its files, and the folder with others.
    files: &'static [&'static str],
    folder: &'static str,
    /// What makes it write, or nothing if it does so by itself.
    writes: fn(&mut Station),
}

const fn by_itself(what: &'static str, args: &'static str, begun: &'static str) -> DiskRow {
    DiskRow {
        what,
        args,
        begun,
        calls: WRITES,
        files: &[],
        folder: "log",
        writes: |_| {},
    }
}

/// What the gateway keeps for or of a station: all of it at once, and then each file for itself.
const fn kept(
    what: &'static str,
    files: &'static [&'static str],
    folder: &'static str,
    writes: fn(&mut Station),
) -> DiskRow {
    DiskRow {
        what,
        args: GATEWAY,
        begun: "ready",
        calls: KEEPS,
        files,
        folder,
        writes,
    }
}

const GATEWAY: &str = "run mavlink";

/// No folder of which all files are held up.
const NONE: &str = "none";

const DISKS: [DiskRow; 7] = [
    by_itself("status", "run status --config status.toml", "log opened"),
    by_itself("record", "record", "recording"),
    kept(
        "mavlink, everything",
        &[
            "state",
            "state/robot-1.home",
            "state/.robot-1.home.new",
            "state/robot-1.mission",
            "state/.robot-1.mission.new",
            "state/.robot-1.progress.new",
            "state/.robot-1.timestamp.new",
        ],
        "state",
        begin_mission,
    ),
    kept(
        "mavlink, home",
        &["state/robot-1.home", "state/.robot-1.home.new"],
        NONE,
        set_home,
    ),
    kept(
        "mavlink, progress",
        &["state/robot-1.progress", "state/.robot-1.progress.new"],
        NONE,
        choose_item,
    ),
    kept(
        "mavlink, timestamp",
        &["state/robot-1.timestamp", "state/.robot-1.timestamp.new"],
        NONE,
        sign_ahead,
    ),
    kept(
        "mavlink, the bridge's fence",
        &["bridge.toml", ".bridge.toml.new"],
        NONE,
        send_fence,
    ),
];

/// Uploads a mission, and does not wait for the answer: the last item lets the gateway keep it.
fn begin_mission(station: &mut Station) {
    let items = mission(UPLOADED, 15.0);
    assert_eq!(upload_until(station, &items, Some(items.len())), None);
}

/// Sets home, beside the helicopter.
fn set_home(station: &mut Station) {
    let here = station.until("a place", |message| message.is(GLOBAL_POSITION_INT.id));
    let degrees = |at| (f64::from(here.i32(at)) / 1e7) as f32;
    let altitude_m = here.i32(12) as f32 / 1e3;
    let home = [
        0.0,
        0.0,
        0.0,
        0.0,
        degrees(4) + 1e-4,
        degrees(8),
        altitude_m,
    ];
    assert_eq!(station.command(179, home), 0);
}

/// Has a mission kept, and chooses another item of it.
fn choose_item(station: &mut Station) {
    assert_eq!(upload(station, &mission(UPLOADED, 15.0)), 0);
    station.send(&MessageWriter::new(MISSION_SET_CURRENT).u16(2).u8(1).u8(1));
}

/// Signs a frame with a clock that is so far ahead that another timestamp is to be kept.
fn sign_ahead(station: &mut Station) {
    let since_1970 = SystemTime::now().duration_since(SystemTime::UNIX_EPOCH);
    let ahead = since_1970.expect("a clock after 1970") + Duration::from_secs(45);
    let (key, now) = (SigningKey::of(PASSPHRASE), MonotonicNs::now());
    let mut signing = Signing::new(key, mavlink_gateway::timestamp(ahead), 0, now);
    let mut frame = heartbeat().frame_to_sign(0, 254, 190);
    signing.sign(&mut frame, now);
    let socket = UdpSocket::bind("127.0.0.1:0").expect("a free port");
    socket
        .send_to(&frame, station.vehicle())
        .expect("it is sent");
}

/// Sends a fence: a circle of 20 m to stay outside, some 90 m to the east.
pub fn send_fence(station: &mut Station) {
    let here = station.until("a place", |message| message.is(GLOBAL_POSITION_INT.id));
    let count = MessageWriter::new(MISSION_COUNT).u16(1);
    station.send(&count.u8(1).u8(1).u8(FENCE));
    station.until("a question", |message| message.is(MISSION_REQUEST_INT.id));
    let circle = MessageWriter::new(MISSION_ITEM_INT).f32(20.0).f32s(0.0, 3);
    let circle = circle.i32(here.i32(4)).i32(here.i32(8) + 10_000).f32(0.0);
    let circle = circle.u16(0).u16(5004).u8(1).u8(1).u8(5).u8(0).u8(1);
    station.send(&circle.u8(FENCE));
}

/// Starts a gateway for these stations, which takes fences and keeps timestamps.
fn configure_gateway(rig: &Sandbox, stations: [&Station; 2]) {
    let stations = stations.map(|station| format!("127.0.0.1:{}", station.port()));
    let config = format!(
        "port = 0\nstations = {stations:?}\nlost_s = 60.0\nstate = 'state'\nkey = 'mavlink.key'\n[fence]\naccept = true\n"
    );
    rig.write("mavlink.toml", &config);
    rig.write("mavlink.key", PASSPHRASE);
    let mode = Permissions::from_mode(0o600);
    fs::set_permissions(rig.path("mavlink.key"), mode).expect("a mode");
}

#[test]
fn a_disk_that_is_held_up_delays_no_telemetry_no_order_and_no_end() {
    if !has_strace("a disk that is held up") {
        return;
    }
    let limits = [GAP, GAP, GAP, ACKNOWLEDGED, ACKNOWLEDGED, ENDED];
    for row in DISKS {
        judge(row.what, limits, |pace| with_disk(&row, pace));
    }
}

/// The longest gap of the robot's telemetry, a station's and a page's; until an order of an operator and one of a
/// station was acknowledged; until the process had ended.
fn with_disk(row: &DiskRow, pace: &Pace) -> [Duration; 6] {
    let mut rig = Rig::new();
    let (mut station, mut listening) = (Station::new(), Station::new());
    let log = "[[log]]\ndirectory = 'log'\ngroups = ['time', 'geographic']\n";
    rig.sandbox.write("status.toml", log);
    configure_gateway(&rig.sandbox, [&station, &listening]);
    let bridge = rig.sandbox.start_ready("run bridge --port dsp-1");
    pace.of_line(&bridge);
    rig.others.push(bridge);
    if !row.args.contains("status") {
        rig.others.push(rig.sandbox.status(1));
    }
    let mut process = rig.sandbox.start(row.args);
    process.wait_for_text(row.begun);
    if row.args != GATEWAY {
        rig.others.push(rig.sandbox.start_ready(GATEWAY));
    }
    let port = free_port();
    let view = format!("XDG_RUNTIME_DIR=. exec \"$0\" run view --port {port}");
    let mut view = Process::spawn(&rig.sandbox.domain, rig.sandbox.shell(&view));
    view.wait_for_text("ready");
    rig.others.push(view);
    rig.sandbox.watch(1).until_ready();
    station.connect();
    listening.connect();
    let mut page = Page::open(port, Some(&token(&rig.sandbox, port)));
    let mut files: Vec<PathBuf> = row
        .files
        .iter()
        .map(|file| rig.sandbox.path(file))
        .collect();
    let folder = fs::read_dir(rig.sandbox.path(row.folder));
    files.extend(
        folder
            .into_iter()
            .flatten()
            .flatten()
            .map(|file| file.path()),
    );
    let held_up = HeldUp::start(&rig.sandbox, &process, row.calls, &files);
    let (mut of_operator, mut of_gateway) = (Duration::ZERO, Duration::ZERO);
    let listeners = [
        pace::telemetry(&rig.sandbox.domain),
        of_station(&mut listening),
        of_page(&mut page),
    ];
    let [robot, at_station, at_page] = gaps(listeners, || {
        (row.writes)(&mut station);
        let asked = Instant::now();
        station.command(193, [0.0; 7]);
        of_gateway = asked.elapsed();
        of_operator = rig.orders().hold_and_land();
    });
    drop(page);
    let ended = ends(process, &[" ended", "the disk did"]);
    HeldUp::end(held_up);
    rig.end();
    [robot, at_station, at_page, of_operator, of_gateway, ended]
}

/// The last step of what keeps a mission is held up: before it the station has no answer, and after it the right one.
#[test]
fn a_mission_is_acknowledged_when_its_file_is_there_and_a_hold_is_done_before() {
    if !has_strace("a mission whose file comes late") {
        return;
    }
    let rig = Rig::new();
    let (mut station, other) = (Station::new(), Station::new());
    configure_gateway(&rig.sandbox, [&station, &other]);
    let bridge = rig.sandbox.start_ready("run bridge --port dsp-1");
    let status = rig.sandbox.status(1);
    rig.sandbox.watch(1).until_ready();
    let mut gateway = rig.sandbox.start_ready(GATEWAY);
    station.connect();
    let files = [rig.sandbox.path("state/.robot-1.mission.new")];
    let held_up = HeldUp::start(&rig.sandbox, &gateway, "rename", &files);
    // A machine that stalls for a second lets the gateway give a mission up, or the hold come late: the next one tells.
    let give_up = Instant::now() + WAIT_LIMIT;
    for height_m in 15.. {
        let items = mission(UPLOADED, height_m as f32);
        let refused = upload_until(&mut station, &items, Some(items.len()));
        station.send(&long(193, [0.0; 7]));
        let mut is_held = false;
        let is_answer = |message: &Received| {
            is_held |= message.is(COMMAND_ACK.id);
            message.is(MISSION_ACK.id)
        };
        let answer = refused.unwrap_or_else(|| station.until("an answer", is_answer).u8(2));
        let file = fs::read(rig.sandbox.path("state/robot-1.mission")).unwrap_or_default();
        let kept = Mission::decode(&file).map(|mission| mission.count());
        assert!(answer != 0 || kept == Ok(UPLOADED), "{kept:?}");
        if answer == 0 && (is_held || held_up.is_none()) {
            break;
        }
        assert!(Instant::now() < give_up, "no answer comes late");
    }
    gateway.signal(Signal::TERM);
    gateway.exits(0);
    HeldUp::end(held_up);
    status.end();
    bridge.end();
    rig.end();
}
