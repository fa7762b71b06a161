//! What a faulty neighbour of the same user can leave in shared memory: the operator's commands, status and the bridge
//! survive all of it, and what is not valid is shown as such. Every failure names the seed that repeats it.

use std::collections::BTreeMap;

use ipc_types::code::Stage;
use ipc_types::payload::{
    DspTelemetry, HeroTelemetry, ModuleControl, ModuleState, MovementData, RelayLink,
    RelayStations, RequestReport,
};
use ipc_types::service::{MAX_OUTSTANDING, Request};
use ipc_types::{
    Client, Losses, MonotonicNs, RobotId, Schema, SendError, Topic, Wake, fresh_request_id,
};
use operator::render::fields::{JsonLine, Plain, Selection, Shown, Tree};
use operator::render::messages::object::ReportObject;
use operator::render::messages::{self, FinalReport, Verb};
use operator::render::stamps::StampReader;
use operator::request::{Exchange, Next, Until};
use ril::verbs::status::report::{Samples, StateReport};
use ril::verbs::topic::histogram::Detail;
use ril::verbs::topic::meter::{Meter, MeterReport, Of, Quantity, Relayed};
use ril_tests::process::{Signal, WAIT_LIMIT};
use ril_tests::{Garbage, StandInBridge};
use serde_json::Value;

use crate::common::{end, json, sandbox, state_of};

const SEEDS: u64 = 2_000;
const NOW: MonotonicNs = MonotonicNs(1 << 50);

/// Neither people nor programs are shown a number that is none.
#[track_caller]
fn check_text(seed: u64, text: &str) {
    for word in ["NaN", "inf"] {
        // Most texts have neither, and looking for words takes long.
        let is_there = text.contains(word)
            && text
                .split(|c: char| !c.is_alphanumeric())
                .any(|part| part == word);
        assert!(!is_there, "seed {seed}: {word} in\n{text}");
    }
}

fn show<T: Shown>(seed: u64, sample: &T) {
    let tree = Tree::of(sample, &Selection::default());
    let line = JsonLine {
        schema: T::TYPE_NAME,
        tree: &tree,
    };
    let text = serde_json::to_string(&line).unwrap();
    serde_json::from_str::<Value>(&text).unwrap_or_else(|error| panic!("seed {seed}: {error}"));
    for (name, value) in tree.plain_fields() {
        check_text(seed, &format!("{name}: {}", Plain(value)));
    }
}

#[test]
fn samples_of_any_bits_are_shown_and_what_means_nothing_is_null() {
    for seed in 0..SEEDS {
        let mut garbage = Garbage::new(seed);
        let (dsp, hero): (DspTelemetry, HeroTelemetry) = (garbage.payload(), garbage.payload());
        let state: ModuleState = garbage.payload();
        show(seed, &dsp);
        show(seed, &hero);
        show(seed, &state);
        let stations: RelayStations = garbage.payload();

        let status = garbage.payload();
        let samples = Samples {
            state: Some(state),
            dsp: Some(dsp),
            hero: Some(hero),
            status: Some(status),
            stations: Some(stations),
            own_session: None,
            has_bridge: true,
            has_status: true,
        };
        let report = StateReport::new(RobotId::DEFAULT, samples, NOW);
        check_text(seed, &report.line());
        check_text(seed, &report.to_string());
        let shown = serde_json::to_value(&report).unwrap();
        let age = &shown["dsp"]["age_ms"];
        match dsp.received_ns <= NOW.0 {
            true => assert!(age.is_number(), "seed {seed}"),
            false => assert!(
                age.is_null() && shown["dsp"]["stale"] == true,
                "seed {seed}"
            ),
        }
    }
}

/// Takes samples until there are enough and says what that makes.
fn measure<T: Topic>(quantity: Quantity, samples: &[T], relayed: Option<Relayed>) -> MeterReport {
    let mut meter = Meter::new(quantity, size_of::<T>());
    let stamps = StampReader::of(&Schema::of::<T>());
    for (index, sample) in samples.iter().enumerate() {
        let now = MonotonicNs(NOW.0 + index as u64);
        meter.take(&stamps.read(sample.bytes(), now), now);
    }
    let of = Of {
        robot: 1,
        service: "test",
        relayed,
    };
    let losses = Losses {
        received: samples.len() as u64,
        lost: u64::MAX,
        ..Losses::default()
    };
    meter.report(of, losses)
}

#[test]
fn samples_of_any_bits_are_measured() {
    fn check<T: Topic>(seed: u64) {
        let mut garbage = Garbage::new(seed);
        let samples: Vec<T> = (0..20).map(|_| garbage.payload()).collect();
        let [before, after]: [RelayLink; 2] = [garbage.payload(), garbage.payload()];
        let relayed = Relayed {
            uncertainty_s: after.clock_uncertainty(),
            air: Some((before.samples_received, after.samples_lost_on_air)),
        };
        for quantity in [Quantity::Rate, Quantity::Age, Quantity::Bandwidth] {
            let report = measure(quantity, &samples, Some(relayed));
            check_text(seed, &report.text(Detail::Histograms));
            serde_json::to_string(&report).unwrap();
        }
    }
    // A report goes through tens of thousands of places of a histogram.
    for seed in 0..5 {
        check::<DspTelemetry>(seed);
        check::<HeroTelemetry>(seed);
        check::<ModuleState>(seed);
    }
}

#[test]
fn reports_of_any_bits_are_shown_and_end_nothing_before_its_time() {
    // Each verb has its turn some thousand times.
    let mut verbs = Verb::ALL.into_iter().cycle();
    for seed in 0..SEEDS {
        let mut garbage = Garbage::new(seed);
        let mut exchange = Exchange::new([1, 2, 3], Until::Final, WAIT_LIMIT);
        let mut is_answered = false;
        exchange.sent(NOW);
        for _ in 0..20 {
            let report: RequestReport = garbage.payload();
            let verb = verbs.next().unwrap();
            if let Some(line) = messages::line(verb, 2, 3, &report) {
                check_text(seed, &line);
            }
            serde_json::to_string(&ReportObject::new(verb, &report)).unwrap();
            if let Some(end) = FinalReport::of(&report) {
                check_text(seed, &messages::ending(verb, &end));
            }
            is_answered |= exchange.take(&report, NOW).is_some();
        }
        if !is_answered {
            let next = exchange.next(NOW);
            assert!(matches!(next, Next::Wait(Some(_))), "seed {seed}: {next:?}");
        }
    }
}

#[test]
fn status_and_the_commands_survive_a_publisher_of_garbage() {
    const SAMPLES: u64 = 500;
    let rig = sandbox();
    rig.write(
        "status.toml",
        "[[log]]\ngroups = ['time', 'geographic', 'gps_quality', 'attitude', 'pilot_pwm', 'supply', 'references']\n",
    );
    let bridge = StandInBridge::start(&rig.domain);
    let mut status = rig.status(1);
    let mut garbage = Garbage::new(7);
    // What can be watched is shown; the last one is as it should be, so that each watcher knows when it has all.
    let mut echoes = BTreeMap::new();
    for topic in ["dsp", "hero", "state"] {
        let echo = rig.start(&format!("echo {topic} --json --timeout 80s"));
        echoes.insert(topic, echo);
    }
    for number in 1..=SAMPLES {
        let sample: DspTelemetry = garbage.payload();
        bridge.publish(&sample);
        let state: ModuleState = garbage.payload();
        bridge.publish_state(&state);
        if number % 250 == 0 {
            // A time that is none is old: code 4, unless the numbers say by chance that the link is down.
            let finished = state_of(&rig, "status --json --timeout 3s");
            assert_eq!(json(&finished.stdout[0])["schema"], "ril.State.v4");
            state_of(&rig, "status --timeout 3s");
        }
    }
    let mut good = DspTelemetry {
        valid_groups: ipc_types::TelemetryGroup::Geographic.bit(),
        ..DspTelemetry::default()
    };
    good.geographic.latitude_deg = 36.0;
    bridge.publish(&good);
    bridge.publish_state(&StandInBridge::idle_state());

    for (topic, end_mark) in [
        ("dsp", "\"latitude_deg\":36.0"),
        ("hero", "\"latitude_rad\":0.628"),
        ("state", "\"status\":\"running\""),
    ] {
        let mut echo = echoes.remove(topic).unwrap();
        echo.wait_for_line(|line| {
            let is_last = !line.text.contains("\"movement\":{\"request_id\":1");
            is_last && line.text.contains(end_mark) && line.text.contains("\"sequence\":50")
        });
        let finished = end(echo, Signal::INT);
        assert!(finished.stdout.len() > 1, "{topic}");
        for line in &finished.stdout {
            check_text(7, line);
            let sample = json(line);
            if topic != "hero" {
                continue;
            }
            let latitude = &sample["geodetic"]["latitude_rad"];
            let can_be = |number: f64| number.abs() <= std::f64::consts::FRAC_PI_2;
            assert!(
                latitude.is_null() || latitude.as_f64().is_some_and(can_be),
                "{line}"
            );
        }
    }
    status.wait_for_text("implausible values were published");
    let finished = end(status, Signal::TERM);
    assert!(
        !finished.stderr.iter().any(|line| line.contains("panicked")),
        "{finished:#?}"
    );
    let log = std::fs::read_dir(rig.folder().join("log"))
        .unwrap()
        .next()
        .unwrap()
        .unwrap();
    let log = std::fs::read_to_string(log.path()).unwrap();
    assert!(
        log.lines().count() as u64 > SAMPLES / 2,
        "{}",
        log.lines().count()
    );
    check_text(7, &log);
}

/// Sends garbage, as many requests as may be open, and waits until each has its final report. Says how many were
/// refused, and how many done.
fn ask<R: Request>(client: &mut Client<R>, garbage: &mut Garbage, number: usize) -> (usize, usize) {
    let (mut sent, mut finals, mut refused, mut done) = (0, 0, 0, 0);
    while sent < number || client.outstanding() > 0 {
        // A client that does not drain keeps the newest 64 reports only.
        let most = number.min(sent + MAX_OUTSTANDING);
        while sent < most {
            match client.send(&garbage.payload()) {
                Ok(_) => sent += 1,
                Err(SendError::TooManyOutstanding | SendError::ServerFull) => break,
                Err(error) => panic!("{error}"),
            }
        }
        let mut count = |report: &RequestReport| {
            finals += usize::from(report.is_final());
            refused += usize::from(report.stage() == Some(Stage::Refused));
            done += usize::from(report.stage() == Some(Stage::Done));
        };
        if client.drain(&mut count) == 0 && client.outstanding() > 0 {
            assert_ne!(
                client.wait(WAIT_LIMIT).unwrap(),
                Wake::TimedOut,
                "no final report"
            );
        }
    }
    assert_eq!(finals, number);
    (refused, done)
}

#[test]
fn the_bridge_survives_a_client_of_garbage_and_serves_the_next() {
    const REQUESTS: usize = 2_000;
    let rig = sandbox();
    let sim = rig.sim(1, "");
    let bridge = rig.bridge(1);
    let mut watch = rig.watch(1);
    watch.until_ready();
    let ipc = rig.domain.join_as(RobotId::DEFAULT, "hostile");
    let mut garbage = Garbage::new(11);
    let mut movements = ipc.client::<MovementData>().unwrap();
    let mut controls = ipc.client::<ModuleControl>().unwrap();
    // What is not refused claims to be sent again, and no bridge remembers it. The module was not started yet.
    let (refused, done) = ask(&mut movements, &mut garbage, REQUESTS);
    assert!(refused > REQUESTS / 4 && done == 0, "{refused}, {done}");
    let (refused, _) = ask(&mut controls, &mut garbage, REQUESTS);
    assert!(refused > REQUESTS / 2, "{refused}");
    // Some are left open by a client that goes.
    for _ in 0..20 {
        let path = MovementData {
            request_id: fresh_request_id(),
            ..garbage.payload()
        };
        let _ = movements.send(&path);
    }
    drop((movements, controls, ipc));

    rig.run("stop", 0);
    rig.run("start", 0);
    let state = watch.until("the refusals are counted", |state| {
        state.refused.requests > 0
    });
    assert!(state.refused.requests as usize > REQUESTS / 4, "{state:#?}");
    end(bridge, Signal::TERM);
    end(sim, Signal::TERM);
}
