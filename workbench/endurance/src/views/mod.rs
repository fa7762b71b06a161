//! What viewers cost `ril run view`, how old what they get is, and what a slow or hostile one does to the others and to the robot.

mod client;
mod hostile;

use std::fs;
use std::path::Path;
use std::process::Command;
use std::time::{Duration, Instant};

use ipc_types::MonotonicNs;
use ipc_types::payload::HeroTelemetry;
use ril_tests::Process;
use ril_tests::sandbox::{Holdings, free_port};
use serde_json::{Value, json};

use crate::outcome::{Outcome, Times};
use crate::plan::Plan;
use crate::site::{Site, count_lines};
use crate::usage::usage_of;
use client::{Client, Kind, Seen, Viewer};
use hostile::Hostile;

/// Pages of the crowd.
const PAGES: u32 = 20;

/// Who looks at the robot at once.
struct Case {
    name: &'static str,
    pages: u32,
    foxglove: Option<Kind>,
    is_attacked: bool,
}

/// The server that is measured: a view, or the peer that is measured beside it.
struct View {
    process: Process,
    port: u16,
    /// Of a view: with it a page may order.
    token: String,
}

/// Each case, one after the other, of the same server: `show` gets its row.
///
/// # Panics
///
/// When a process does not come up or a viewer is not taken.
pub fn run(site: &Site, plan: &Plan, goes_on: &dyn Fn() -> bool, show: &mut dyn FnMut(Outcome)) {
    let case = |name, pages, foxglove| Case {
        name,
        pages,
        foxglove,
        is_attacked: false,
    };
    let cases = [
        case("no viewer", 0, None),
        case("1 page", 1, None),
        case("20 pages", PAGES, None),
        case("Foxglove, all topics", 0, Some(Kind::Foxglove)),
        case("Foxglove at 50 kB/s", 0, Some(Kind::Throttled)),
        case(
            "20 pages, Foxglove at 50 kB/s",
            PAGES,
            Some(Kind::Throttled),
        ),
        Case {
            is_attacked: true,
            ..case("20 pages, attacked", PAGES, None)
        },
    ];
    let mut chain = site.start_chain_at(1);
    site.ask("start");
    let mut view = View::start(site);
    for case in cases {
        if goes_on() {
            show(measure(site, plan, &mut view, &mut chain[1], &case));
        }
    }
    view.process.end();
    if let Some(program) = plan.beside.as_deref().filter(|_| goes_on()) {
        let mut peer = View::start_peer(site, program);
        for case in [
            case("crate foxglove: none", 0, None),
            case("crate foxglove: all topics", 0, Some(Kind::Foxglove)),
            case("crate foxglove: at 50 kB/s", 0, Some(Kind::Throttled)),
        ] {
            if goes_on() {
                show(measure(site, plan, &mut peer, &mut chain[1], &case));
            }
        }
        // It handles no signals; what it leaves in shared memory is swept.
        site.kill(peer.process);
    }
    site.end(chain, plan.beside.is_some());
}

impl View {
    fn start(site: &Site) -> View {
        let port = free_port();
        let mut command = site.command(["run", "view", "--port", &port.to_string()]);
        command.env("XDG_RUNTIME_DIR", site.folder());
        let mut process = site.spawn(command);
        process.wait_for_text("ready");
        let file = site.path(&format!("ril/view-{port}.json"));
        let text = fs::read_to_string(file).expect("the file of the running view");
        let running: Value = serde_json::from_str(&text).expect("JSON");
        let token = running["token"].as_str().expect("a token").to_owned();
        View {
            process,
            port,
            token,
        }
    }

    /// Starts the program that is compared with the view.
    fn start_peer(site: &Site, program: &Path) -> View {
        let port = free_port();
        let mut command = Command::new(program);
        command.arg(port.to_string());
        let mut process = site.spawn(command);
        process.wait_for_text("ready");
        View {
            process,
            port,
            token: String::new(),
        }
    }
}

fn measure(
    site: &Site,
    plan: &Plan,
    view: &mut View,
    bridge: &mut Process,
    case: &Case,
) -> Outcome {
    let kinds = (0..case.pages)
        .map(|_| Kind::Page(view.token.clone()))
        .chain(case.foxglove.clone());
    let viewers: Vec<Viewer> = kinds.map(|kind| Viewer::start(view.port, &kind)).collect();
    let (connections, per_second) = match plan.is_short {
        true => (100, 500),
        false => (1_000, 10_000),
    };
    let lands_before = count_lines(bridge, "command=\"land\"");
    let hostile = case
        .is_attacked
        .then(|| Hostile::start(view.port, connections, per_second, plan.seed));
    let (before, begun) = (usage_of(&view.process), Instant::now());
    let first_report = case.is_attacked.then(|| land(view));
    let status_ages = ages(site, plan.duration(60));
    let seconds = begun.elapsed().as_secs_f64();
    let cpu = usage_of(&view.process).since(&before).all_percent;
    let memory_kib = Holdings::of(view.process.id()).memory_kib;
    let attack = hostile.map(Hostile::end);
    let seen: Vec<Seen> = viewers.into_iter().map(Viewer::end).collect();

    let mut outcome = Outcome::default();
    outcome.cell("viewers", case.name);
    outcome.cell("processor", format!("{cpu:.2} %"));
    outcome.cell("memory", format!("{:.1} MB", memory_kib as f64 / 1024.0));
    report_seen(&mut outcome, &seen, seconds);
    outcome.cell(
        "received by the bridge to a consumer of status",
        status_ages,
    );
    let Some((connections, sent)) = attack else {
        outcome.cell("attack", "–");
        return outcome;
    };
    let report = first_report.flatten();
    let lands = count_lines(bridge, "command=\"land\"") - lands_before;
    outcome.cell(
        "attack",
        format!(
            "{connections} connections, {:.0} heads and frames a second, `land` answered after {} ms",
            sent as f64 / seconds,
            report.map_or_else(|| "–".to_owned(), |time| time.as_millis().to_string()),
        ),
    );
    outcome.require(
        lands == 1,
        format!("the bridge got {lands} requests to land"),
    );
    outcome.require(report.is_some(), "the order to land was not answered");
    outcome
}

/// What viewers got: all of them stay to the end, and each gets values.
fn report_seen(outcome: &mut Outcome, seen: &[Seen], seconds: f64) {
    let closed = seen.iter().filter(|one| one.is_closed).count();
    let empty = seen.iter().filter(|one| one.values == 0).count();
    outcome.require(closed == 0, format!("{closed} viewers were closed"));
    outcome.require(empty == 0, format!("{empty} viewers got no value"));
    let rate = |bytes: u64| format!("{:.1}", bytes as f64 / seconds / 1e3);
    let rates: Vec<String> = match seen {
        [] => vec!["–".to_owned()],
        [first, .., last] => [first, last].map(|one| rate(one.bytes)).to_vec(),
        [one] => vec![rate(one.bytes)],
    };
    outcome.cell("kB/s to the first and the last", rates.join(", "));
    let left_out: u64 = seen.iter().map(|one| one.left_out).sum();
    outcome.cell("values", seen.iter().map(|one| one.values).sum::<u64>());
    outcome.cell("left out", left_out);
    let ages = |seen: &[Seen]| Times(seen.iter().flat_map(|one| one.ages.0.clone()).collect());
    let (crowd, last) = match seen {
        [crowd @ .., last] => (ages(crowd), ages(std::slice::from_ref(last))),
        [] => Default::default(),
    };
    outcome.cell("age at the last viewer", last);
    outcome.cell("at the others", crowd);
}

/// Orders to land as a pilot at a page would; says after what time the first report was there.
fn land(view: &View) -> Option<Duration> {
    let mut page = Client::connect(view.port, &Kind::Page(view.token.clone()));
    while page.next_message()?["type"] != "robot" {}
    let begun = Instant::now();
    page.send(&json!({"type": "order", "order": "l1", "robot": 1, "kind": "land", "seen": 0, "position": null,
        "altitude_m": null, "confirm": null}));
    loop {
        let message = page.next_message()?;
        if message["type"] == "order" && message["order"] == "l1" {
            return Some(begun.elapsed());
        }
    }
}

/// How old telemetry in SI units is where a consumer gets it.
fn ages(site: &Site, duration: Duration) -> Times {
    let mut telemetry = site.subscribe::<HeroTelemetry>(1);
    let (begun, mut ages) = (Instant::now(), Times::default());
    while begun.elapsed() < duration {
        let sample = telemetry.next_sample();
        ages.push(MonotonicNs::now().since(sample.received()));
    }
    ages
}
