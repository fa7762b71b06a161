//! Pages: what they are sent, who may order, and who commands.

use std::time::Duration;

use serde_json::{Value, json};
use view::page::{
    CheckResult, Event as PageEvent, OrderKind, OrderReport, OrderStage, Past, ReplayStatus,
    Robots, Severity, Weight,
};
use view::{
    BEAT_PERIOD, Event, LEASE_TIME, MAX_TEXTS, MEMORY, OPEN_TIME, PING_PERIOD, SILENCE, Settings,
};

use crate::common::{
    Client, PING, SECRET, WATCH, World, frame, open, order, own, peer, replay, settings, values,
};

fn world() -> World {
    World::new(settings())
}

fn report(number: &str, stage: OrderStage) -> OrderReport {
    OrderReport {
        order: number.into(),
        robot: 1,
        kind: OrderKind::Land,
        stage,
        text: "t".into(),
        is_final: stage == OrderStage::Done,
    }
}

fn event(robot: u32, text: &str) -> PageEvent {
    PageEvent {
        robot,
        at_unix_ms: 1,
        severity: Weight::Note,
        text: text.into(),
    }
}

fn lease(robot: u32, action: &str) -> Value {
    json!({"type": "lease", "robot": robot, "action": action})
}

/// Who has the lease, as the newest message says.
fn holder(world: &mut World, page: &mut Client) -> Option<(String, bool)> {
    let messages = world.of_type(page, "lease");
    let newest = messages.last()?;
    Some((
        newest["holder"].as_str()?.to_owned(),
        newest["asked"].as_bool()?,
    ))
}

#[test]
fn a_page_that_opens_is_greeted_and_its_robot_is_asked_for() {
    let mut world = world();
    for (token, robot, role, looks_at) in [
        (None, None, "watch", 1),
        (Some("wrong"), Some(2), "watch", 2),
        (Some(WATCH), Some(2), "watch", 2),
        (Some(SECRET), Some(9), "command", 1),
    ] {
        let mut page = world.viewer(own(), "/", "hero.view.v1");
        assert!(world.messages(&mut page).is_empty());
        world.say(&page, &open(token, robot));
        let messages = world.messages(&mut page);
        let hello = json!({"type": "hello", "protocol": "hero.view.v1", "build": world.server.build(), "instance": "life",
            "role": role, "robots": [1, 2], "replay": null, "report": false, "tiles": null, "stale_after_ms": 1500});
        assert_eq!(messages[0], hello);
        let free = json!({"type": "lease", "robot": looks_at, "holder": "none", "asked": false, "asks": false, "expires_ms": null});
        assert_eq!(messages[1..], [free]);
        let events = world.events();
        assert!(
            matches!(events[..], [Event::Joined { robot, .. }] if robot == looks_at),
            "{events:?}"
        );
        assert_eq!(world.server.watched().collect::<Vec<_>>(), [looks_at]);
        world.server.closed(page.id, world.now);
        assert!(world.events().is_empty() && !world.server.has_viewers());
    }
}

#[test]
fn who_may_not_look_is_told_why() {
    for (from, token, works) in [
        (peer("127.0.0.1:5", false), None, false),
        (peer("127.0.0.1:5", false), Some("wrong"), false),
        (peer("127.0.0.1:5", false), Some(WATCH), true),
        (peer("10.0.0.1:5", false), None, false),
        (peer("10.0.0.1:5", false), Some(SECRET), true),
    ] {
        let mut world = world();
        let mut page = world.viewer(from, "/", "hero.view.v1");
        world.say(&page, &open(token, None));
        if works {
            assert_eq!(world.of_type(&mut page, "hello").len(), 1);
            continue;
        }
        let frames = world.frames(&mut page);
        let told: Value = serde_json::from_slice(&frames[0].1).unwrap();
        assert_eq!(
            (frames.len(), &told["type"]),
            (2, &json!("refused")),
            "{frames:?}"
        );
        assert_eq!(frames[1].1[..2], 1008_u16.to_be_bytes());
        assert!(world.server.is_ended(page.id));
        // Nothing is said to it, and what it still says is not read.
        world.say(&page, &order("a", "land", 0));
        world.say_now(1, 1);
        assert!(world.frames(&mut page).is_empty() && world.orders().is_empty());
        assert!(!world.server.has_viewers());
    }
}

#[test]
fn what_is_said_reaches_those_who_look_at_the_robot() {
    let mut world = world();
    let (mut one, mut two) = (world.page(None, 1), world.page(None, 2));
    let Some(Event::Joined { viewer, .. }) = world.server.poll_event() else {
        panic!("a page")
    };
    for page in [&mut one, &mut two] {
        world.messages(page);
    }
    world.server.send_robots(&Robots { robots: vec![] });
    world.server.event(&event(1, "first"));
    world.server.event(&event(2, "second"));
    let past = |robot| Past {
        robot,
        track: vec![],
        t_s: vec![-1.0],
        altitude_m: vec![None],
        ground_speed_mps: vec![None],
        battery_v: vec![None],
        phases: vec![],
        events: vec![],
    };
    world.server.past(viewer, &past(1));
    // It is late for a page that looks at another robot by now.
    world.server.past(viewer, &past(2));
    world.server.replay(&ReplayStatus {
        position_s: 1.0,
        playing: true,
        speed: 2.0,
    });
    world.say_now(1, 7);
    let kinds = |messages: Vec<Value>| -> Vec<String> {
        messages
            .iter()
            .map(|one| one["type"].as_str().unwrap().to_owned())
            .collect()
    };
    let messages = world.messages(&mut one);
    assert_eq!(messages.last().unwrap()["n"], 7);
    assert_eq!(
        messages.last().unwrap()["ground_speed_mps"],
        Value::Null,
        "no number is null"
    );
    assert_eq!(
        kinds(messages),
        ["robots", "event", "past", "replay", "now"]
    );
    assert_eq!(
        kinds(world.messages(&mut two)),
        ["robots", "event", "replay"]
    );
    // After another `open` it looks at the other one.
    world.say(&one, &open(None, Some(2)));
    assert_eq!(world.server.watched().collect::<Vec<_>>(), [2]);
    world.say_now(1, 8);
    world.say_now(2, 9);
    let messages = world.messages(&mut one);
    assert_eq!(kinds(messages.clone()), ["lease", "now"]);
    assert_eq!(messages[1]["n"], 9);
    let events = world.events();
    assert!(
        events
            .iter()
            .any(|event| matches!(event, Event::Joined { robot: 2, .. })),
        "{events:?}"
    );
}

#[test]
fn beats_and_pings_come_in_time_and_a_silent_page_is_closed() {
    let mut world = world();
    let mut page = world.page(None, 1);
    world.messages(&mut page);
    let mut beats = 0;
    let mut pings = 0;
    let end = world.now + SILENCE;
    while !world.server.is_ended(page.id) {
        let deadline = world.server.deadline().expect("a beat is always due");
        assert!(
            deadline > world.now && deadline <= world.now + BEAT_PERIOD,
            "{deadline:?}"
        );
        world.pass(deadline.since(world.now));
        let frames = world.frames(&mut page);
        pings += frames.iter().filter(|(opcode, _)| *opcode == PING).count();
        beats += frames.len();
    }
    assert_eq!(world.now, end);
    assert_eq!((pings, beats - pings), (2, 29));
    assert_eq!(SILENCE.as_secs() / PING_PERIOD.as_secs() - 1, 2);
    // A pong is a sign.
    let mut page = world.page(None, 1);
    for _ in 0..10 {
        world.pass(PING_PERIOD);
        world.send(&page, &frame(0x8a, b""));
    }
    assert!(!world.server.is_ended(page.id));
    // A stall is not made up for.
    world.messages(&mut page);
    world.pass(Duration::from_secs(14));
    let beats = world.of_type(&mut page, "beat");
    assert_eq!((beats.len(), &beats[0]["unix_ms"]), (1, &Value::Null));
    // A page shows when it heard of the server by the server's clock.
    world.server.set_wall_clock(1_800_000_000_000_000_000);
    world.pass(BEAT_PERIOD);
    let unix_ms = 1_800_000_000_000 + world.now.0 / 1_000_000;
    assert_eq!(world.of_type(&mut page, "beat")[0]["unix_ms"], unix_ms);
}

#[test]
fn a_page_that_does_not_open_is_closed() {
    let mut world = world();
    let mut page = world.viewer(own(), "/", "hero.view.v1");
    world.pass(OPEN_TIME - Duration::from_nanos(1));
    assert_eq!(world.close_code(&mut page), None);
    world.pass(Duration::from_nanos(1));
    assert_eq!(world.close_code(&mut page), Some(1008));
}

#[test]
fn a_ping_of_the_page_has_the_servers_time() {
    let mut world = world();
    let mut page = world.page(None, 1);
    world.say(&page, &json!({"type": "ping", "id": "17"}));
    let expected = json!({"type": "pong", "id": "17", "sent_ms": 1_000_000});
    assert_eq!(world.of_type(&mut page, "pong"), [expected]);
}

#[test]
fn what_means_nothing_closes_with_its_code() {
    let message = |text: &str| frame(0x81, text.as_bytes());
    let cases = [
        ("no JSON", message("{"), 1007),
        ("no object", message("[1]"), 1007),
        ("no type", message("{}"), 1007),
        ("another type", message("{\"type\":\"fly\"}"), 1007),
        (
            "a field of another type",
            message("{\"type\":\"seen\",\"n\":-1}"),
            1007,
        ),
        (
            "a number that is none",
            message("{\"type\":\"open\",\"rate_hz\":1e999}"),
            1007,
        ),
        (
            "another order",
            message(&order("a", "explode", 0).to_string()),
            1007,
        ),
        (
            "a number of an order that is none",
            message(&order("a b", "land", 0).to_string()),
            1007,
        ),
        (
            "a long name of a ping",
            message(&json!({"type": "ping", "id": "x".repeat(65)}).to_string()),
            1007,
        ),
        ("deep JSON", message(&"[".repeat(60_000)), 1007),
        ("binary", frame(0x82, b"x"), 1007),
        ("bad UTF-8", frame(0x81, b"\xff"), 1007),
        ("unmasked", vec![0x81, 0], 1002),
        ("reserved bits", frame(0xf1, b"x"), 1002),
    ];
    let mut world = world();
    for (name, bytes, code) in cases {
        let mut page = world.page(Some(SECRET), 1);
        world.messages(&mut page);
        world.send(&page, &bytes);
        assert_eq!(world.close_code(&mut page), Some(code), "{name}");
        world.say(&page, &order("z", "land", 0));
        world.server.closed(page.id, world.now);
        assert!(world.orders().is_empty(), "{name}");
    }
    // Nothing counts before `open`.
    let mut page = world.viewer(own(), "/", "hero.view.v1");
    world.say(&page, &order("z", "land", 0));
    assert_eq!(world.close_code(&mut page), Some(1007));
}

#[test]
fn too_many_messages_close_the_page() {
    let mut world = world();
    let mut page = world.page(None, 1);
    for _ in 1..view::pace::MESSAGES_PER_S {
        world.say(&page, &json!({"type": "seen", "n": 0}));
    }
    world.messages(&mut page);
    world.pass_ms(999);
    assert_eq!(world.close_code(&mut page), None);
    world.send(&page, &frame(0x89, b""));
    assert_eq!(world.close_code(&mut page), Some(1008));
}

#[test]
fn a_slow_page_sees_the_newest_and_others_lose_nothing() {
    let mut world = world();
    let (mut slow, mut good) = (world.page(None, 1), world.page(None, 1));
    world.messages(&mut slow);
    world.messages(&mut good);
    // The kernel takes nothing of the slow one's bytes for a second; the good one draws all.
    let mut drawn = Vec::new();
    for n in 1..=20 {
        world.say_now(1, n);
        for now in world.of_type(&mut good, "now") {
            assert_eq!(now["left_out"], 0);
            drawn.push(now["n"].as_u64().unwrap());
            world.say(&good, &json!({"type": "seen", "n": now["n"]}));
        }
        world.write(&mut slow, 0);
        world.pass_ms(50);
    }
    assert_eq!(drawn, (1..=20).collect::<Vec<u64>>());
    // What was ready at the beginning is old; then comes the newest.
    let late: Vec<_> = world
        .of_type(&mut slow, "now")
        .iter()
        .map(|now| now["n"].as_u64().unwrap())
        .collect();
    assert_eq!(late, [1, 20]);
    world.say_now(1, 21);
    assert!(world.of_type(&mut slow, "now").is_empty(), "two are unseen");
    world.say(&slow, &json!({"type": "seen", "n": 20}));
    world.pass_ms(50);
    assert_eq!(world.of_type(&mut slow, "now")[0]["n"], 21);
}

#[test]
fn a_page_that_is_too_slow_for_events_gets_all_anew_once_its_line_is_free() {
    let mut world = world();
    let mut page = world.page(Some(SECRET), 1);
    world.messages(&mut page);
    world.say(&page, &order("a", "land", 0));
    world.events();
    // Something is on its way, so nothing more is made ready.
    world.server.event(&event(1, "on its way"));
    world.write(&mut page, 1);
    for index in 0..=MAX_TEXTS {
        world.server.event(&event(1, &index.to_string()));
    }
    assert!(world.events().is_empty(), "its line is not free");
    let messages = world.messages(&mut page);
    let kinds: Vec<_> = messages
        .iter()
        .map(|one| one["type"].as_str().unwrap())
        .collect();
    assert_eq!(kinds, ["event", "lease", "order"]);
    assert_eq!(
        (&messages[0]["text"], &messages[2]["order"]),
        (&json!("on its way"), &json!("a"))
    );
    assert!(matches!(
        world.events()[..],
        [Event::Joined { robot: 1, .. }]
    ));
    world.server.event(&event(1, "new"));
    assert_eq!(world.of_type(&mut page, "event")[0]["text"], "new");
}

#[test]
fn a_hidden_page_gets_no_values_and_then_the_past() {
    let mut world = world();
    let mut page = world.page(None, 1);
    world.events();
    world.messages(&mut page);
    world.say_now(1, 1);
    world.say(&page, &json!({"type": "hidden", "hidden": true}));
    world.say_now(1, 2);
    assert!(world.of_type(&mut page, "now").is_empty());
    assert!(world.events().is_empty());
    world.say(&page, &json!({"type": "hidden", "hidden": false}));
    assert!(matches!(
        world.events()[..],
        [Event::Joined { robot: 1, .. }]
    ));
    world.say_now(1, 3);
    assert_eq!(world.of_type(&mut page, "now")[0]["n"], 3);
}

#[test]
fn each_order_by_role_lease_and_what_was_seen() {
    // Token, who has the lease, how old the values are that it names, and whether hold and land, and all others go
    // through.
    let old = 2001;
    for (token, leads, age_ms, calm, others) in [
        (Some(SECRET), true, 0, true, true),
        (Some(SECRET), true, 2000, true, true),
        (Some(SECRET), true, old, true, false),
        (Some(SECRET), false, 0, true, false),
        (Some(WATCH), false, 0, false, false),
        (None, false, 0, false, false),
    ] {
        for (kind, expected) in [
            ("hold", calm),
            ("land", calm),
            ("goto", others),
            ("takeoff", others),
            ("start", others),
            ("stop", others),
        ] {
            let mut world = world();
            let mut page = world.page(token, 1);
            if leads {
                world.say(&page, &lease(1, "take"));
            }
            world.say_now(1, 5);
            world.messages(&mut page);
            world.pass_ms(age_ms);
            world.say(&page, &order("a", kind, 5));
            let passed = !world.orders().is_empty();
            assert_eq!(passed, expected, "{kind} {token:?} {leads} {age_ms}");
            let answers = world.of_type(&mut page, "order");
            match passed {
                true => assert!(answers.is_empty()),
                false => assert_eq!(
                    (&answers[0]["stage"], &answers[0]["final"]),
                    (&json!("not-sent"), &json!(true))
                ),
            }
        }
    }
}

#[test]
fn an_order_names_values_that_this_page_was_sent() {
    let mut world = world();
    let mut page = world.page(Some(SECRET), 1);
    world.say(&page, &lease(1, "take"));
    world.say_now(1, 5);
    // It waits here, so the pilot cannot have seen it.
    world.say(&page, &order("a", "takeoff", 5));
    world.messages(&mut page);
    world.say(&page, &order("b", "takeoff", 4));
    world.say(&page, &order("c", "takeoff", 5));
    assert_eq!(world.orders(), ["c"]);
    // Of another robot it has seen nothing.
    world.say(&page, &open(None, Some(2)));
    let mut other = order("d", "land", 5);
    world.say(&page, &other);
    other["robot"] = json!(2);
    other["order"] = json!("e");
    world.say(&page, &other);
    assert_eq!(world.orders(), ["e"]);
}

#[test]
fn an_order_is_let_through_once_and_answered_each_time() {
    let mut world = world();
    let (mut page, mut other) = (world.page(Some(SECRET), 1), world.page(Some(SECRET), 1));
    world.messages(&mut page);
    world.messages(&mut other);
    for _ in 0..3 {
        world.say(&page, &order("a", "land", 0));
    }
    world.say(&other, &order("a", "hold", 0));
    assert_eq!(world.orders(), ["a"]);
    world.messages(&mut page);
    world.messages(&mut other);
    world.server.order(&report("a", OrderStage::Accepted));
    for page in [&mut page, &mut other] {
        assert_eq!(world.of_type(page, "order")[0]["stage"], "accepted");
    }
    // The page is loaded again, and finds it.
    world.server.closed(page.id, world.now);
    let mut page = world.page(Some(SECRET), 1);
    assert_eq!(world.of_type(&mut page, "order")[0]["stage"], "accepted");
    world.server.order(&report("a", OrderStage::Done));
    world.pass(MEMORY - Duration::from_secs(1));
    // Those that were silent meanwhile are gone.
    let mut page = world.page(Some(SECRET), 1);
    world.say(&page, &order("a", "land", 0));
    assert_eq!(world.of_type(&mut page, "order")[0]["stage"], "done");
    assert!(world.orders().is_empty());
    // What was refused is not executed later either.
    world.say(&page, &order("b", "start", 0));
    world.say(&page, &lease(1, "take"));
    world.say_now(1, 9);
    world.messages(&mut page);
    world.say(&page, &order("b", "start", 9));
    assert_eq!(world.of_type(&mut page, "order")[0]["stage"], "not-sent");
    assert!(world.orders().is_empty());
}

#[test]
fn a_page_that_may_only_look_cannot_use_up_the_numbers_of_others() {
    let mut world = world();
    let (watcher, page) = (world.page(None, 1), world.page(Some(SECRET), 1));
    world.say(&watcher, &order("a", "land", 0));
    let events = world.events();
    let not_sent = events.iter().find_map(|event| match event {
        Event::NotSent { from, text, .. } => Some((from.as_str(), text.as_str())),
        _ => None,
    });
    assert_eq!(
        not_sent,
        Some((
            "127.0.0.1:50000",
            "this page may only look: open it with `ril view`"
        ))
    );
    world.say(&page, &order("a", "land", 0));
    assert_eq!(world.orders(), ["a"]);
}

#[test]
fn five_orders_a_second_and_no_more() {
    let mut world = world();
    let page = world.page(Some(SECRET), 1);
    let mut other = world.page(Some(SECRET), 1);
    for index in 0..7 {
        world.say(&page, &order(&format!("a{index}"), "hold", 0));
    }
    world.say(&other, &order("b", "hold", 0));
    assert_eq!(world.orders(), ["a0", "a1", "a2", "a3", "a4", "b"]);
    world.pass_ms(1000);
    // What is refused counts, and is logged as often.
    for index in 0..7 {
        world.say(&page, &order(&format!("b{index}"), "start", 0));
    }
    let refused = world.events();
    assert_eq!(refused.len(), 5, "{refused:?}");
    world.pass_ms(1000);
    world.say(&page, &order("a8", "hold", 0));
    assert_eq!(world.orders(), ["a8"]);
    // Questions are counted with them.
    let check = json!({"type": "check", "order": "c", "robot": 1, "kind": "takeoff", "position": null, "altitude_m": 5.0});
    world.messages(&mut other);
    for _ in 0..6 {
        world.say(&other, &check);
    }
    let asked = world
        .events()
        .into_iter()
        .filter(|event| matches!(event, Event::Check { .. }))
        .count();
    assert_eq!(asked, 5);
    let answers = world.of_type(&mut other, "check");
    assert_eq!(
        (answers.len(), &answers[0]["severity"]),
        (1, &json!("alarm"))
    );
}

#[test]
fn a_check_is_answered_to_the_page_that_asked() {
    let mut world = world();
    let (mut page, mut other) = (world.page(Some(SECRET), 1), world.page(Some(SECRET), 1));
    world.events();
    let ask = json!({"type": "check", "order": "c", "robot": 1, "kind": "goto", "position": [48.0, 11.0], "altitude_m": 5.0});
    world.say(&page, &ask);
    let [Event::Check { viewer, check }] = &world.events()[..] else {
        panic!("a question")
    };
    assert_eq!(
        (check.position, check.altitude_m),
        (Some([48.0, 11.0]), Some(5.0))
    );
    let answer = CheckResult {
        order: "c".into(),
        robot: 1,
        severity: Severity::Ok,
        findings: vec![],
        distance_m: Some(1.0),
        duration_s: None,
    };
    world.server.check(*viewer, &answer);
    assert_eq!(world.of_type(&mut page, "check")[0]["distance_m"], 1.0);
    assert!(world.of_type(&mut other, "check").is_empty());
    let mut watcher = world.page(None, 1);
    world.events();
    world.say(&watcher, &ask);
    assert!(world.events().is_empty());
    assert_eq!(world.of_type(&mut watcher, "check")[0]["severity"], "alarm");
}

#[test]
fn command_passes_among_pages() {
    let mut world = world();
    let (mut one, mut two) = (world.page(Some(SECRET), 1), world.page(Some(SECRET), 1));
    let mut watcher = world.page(None, 1);
    let some = |holder: &str, asked| Some((holder.to_owned(), asked));
    world.say(&one, &lease(1, "take"));
    assert_eq!(holder(&mut world, &mut one), some("you", false));
    assert_eq!(holder(&mut world, &mut two), some("other", false));
    assert_eq!(holder(&mut world, &mut watcher), some("other", false));
    // A page that may only look cannot take it, nor one of another robot.
    world.say(&watcher, &lease(1, "take"));
    world.say(&two, &lease(2, "take"));
    assert_eq!(holder(&mut world, &mut one), None);
    world.say(&two, &lease(1, "take"));
    assert_eq!(holder(&mut world, &mut one), some("you", true));
    // Each page knows whether it is the one that asks, and so that it was refused.
    let asks = |world: &mut World, page: &mut Client| {
        let messages = world.of_type(page, "lease");
        messages.last().and_then(|newest| newest["asks"].as_bool())
    };
    assert_eq!(asks(&mut world, &mut watcher), Some(false));
    assert_eq!(asks(&mut world, &mut two), Some(true));
    world.say(&one, &lease(1, "keep"));
    let kept = world.of_type(&mut two, "lease");
    let kept = kept
        .last()
        .map(|message| (&message["holder"], &message["asked"], &message["asks"]));
    assert_eq!(kept, Some((&json!("other"), &json!(false), &json!(false))));
    world.say(&two, &lease(1, "take"));
    world.say(&one, &lease(1, "give"));
    assert_eq!(holder(&mut world, &mut one), some("other", false));
    assert_eq!(holder(&mut world, &mut two), some("you", false));
    // Without an answer it passes after 5 s; signs of the holder do not matter.
    world.say(&one, &lease(1, "take"));
    world.pass_ms(4999);
    world.say(&two, &json!({"type": "seen", "n": 0}));
    assert_eq!(holder(&mut world, &mut one), some("other", true));
    world.pass_ms(1);
    assert_eq!(holder(&mut world, &mut one), some("you", false));
    world.server.closed(one.id, world.now);
    let events = world.events();
    let texts = events.iter().filter_map(|event| match event {
        Event::Lease { robot: 1, text } => Some(text.as_str()),
        _ => None,
    });
    let commands = "the page of 127.0.0.1:50000 (page) commands";
    assert_eq!(
        texts.collect::<Vec<_>>(),
        [commands, commands, commands, "no page commands any more"]
    );
    assert_eq!(holder(&mut world, &mut two), some("none", false));
}

/// A page of this name that has opened.
fn named(world: &mut World, name: &str, robot: u32) -> Client {
    let client = world.viewer(own(), "/", "hero.view.v1");
    let mut message = open(Some(SECRET), Some(robot));
    message["page"] = json!(name);
    world.say(&client, &message);
    client
}

#[test]
fn a_page_that_is_back_commands_again_unless_another_one_does() {
    let you = Some(("you".to_owned(), false));
    for (is_ended, away_ms) in [(true, 1000), (false, 1000), (true, 60_000), (false, 11_000)] {
        let mut world = world();
        let mut page = named(&mut world, "tab", 1);
        world.say(&page, &lease(1, "take"));
        assert_eq!(holder(&mut world, &mut page), you);
        // It was loaded again, or its network was cut and the server does not know that yet.
        if is_ended {
            world.server.closed(page.id, world.now);
        }
        world.pass_ms(away_ms);
        let mut page = named(&mut world, "tab", 1);
        assert_eq!(holder(&mut world, &mut page), you, "{is_ended} {away_ms}");
        assert!(world.server.is_commanded(1));
    }
    let mut world = world();
    let mut page = named(&mut world, "tab", 1);
    world.say(&page, &lease(1, "take"));
    // Hidden, and shown again.
    world.say(&page, &json!({"type": "hidden", "hidden": true}));
    world.pass_ms(11_000);
    assert!(!world.server.is_commanded(1));
    world.say(&page, &json!({"type": "hidden", "hidden": false}));
    assert_eq!(holder(&mut world, &mut page), you);
    // Another name is another page, and so is one without a name or a right.
    world.server.closed(page.id, world.now);
    let _ = (named(&mut world, "other", 1), world.page(Some(SECRET), 1));
    let watch = world.viewer(own(), "/", "hero.view.v1");
    world.say(
        &watch,
        &json!({"type": "open", "token": WATCH, "robot": 1, "rate_hz": 20, "page": "tab"}),
    );
    assert!(!world.server.is_commanded(1));
    // What was given up, or left for another robot, is not taken again.
    for leaves in [lease(1, "release"), open(None, Some(2))] {
        let page = named(&mut world, "tab", 1);
        world.say(&page, &lease(1, "take"));
        world.say(&page, &leaves);
        world.server.closed(page.id, world.now);
        named(&mut world, "tab", 1);
        assert!(!world.server.is_commanded(1), "{leaves}");
    }
    // Another page has it meanwhile, and it is gone again.
    let (page, mut other) = (named(&mut world, "tab", 1), named(&mut world, "other", 1));
    world.say(&page, &lease(1, "take"));
    world.server.closed(page.id, world.now);
    world.say(&other, &lease(1, "take"));
    named(&mut world, "tab", 1);
    assert_eq!(holder(&mut world, &mut other), you);
    world.say(&other, &lease(1, "release"));
    named(&mut world, "tab", 1);
    assert!(!world.server.is_commanded(1));
}

#[test]
fn an_order_has_the_moment_of_what_its_page_had_drawn() {
    let mut world = world();
    let mut page = world.page(Some(SECRET), 1);
    let opened = world.now;
    let issued = |world: &mut World| {
        let orders = world.events().into_iter();
        orders
            .filter_map(|event| match event {
                Event::Order { issued, .. } => Some(issued),
                _ => None,
            })
            .collect::<Vec<_>>()
    };
    // Pressed before anything was drawn: the page had asked for it.
    world.pass_ms(700);
    world.say(&page, &order("a", "hold", 0));
    assert_eq!(issued(&mut world), [opened]);
    world.say_now(1, 5);
    let made = world.now;
    world.messages(&mut page);
    world.pass_ms(100);
    world.say(&page, &json!({"type": "seen", "n": 5}));
    world.say(&page, &order("b", "hold", 5));
    assert_eq!(issued(&mut world), [made]);
    // The way to the server stalls after the press: what is read 12 s later was given 12 s ago.
    world.say_now(1, 6);
    let made = world.now;
    world.messages(&mut page);
    world.pass_ms(12_000);
    world.say(&page, &json!({"type": "seen", "n": 6}));
    for (number, kind) in [("c", "hold"), ("d", "land")] {
        world.say(&page, &order(number, kind, 6));
    }
    assert_eq!(issued(&mut world), [made, made]);
}

#[test]
fn a_page_that_gives_no_sign_or_is_hidden_loses_command() {
    let mut world = world();
    let (one, mut two) = (world.page(Some(SECRET), 1), world.page(Some(SECRET), 1));
    let seen = json!({"type": "seen", "n": 0});
    world.say(&one, &lease(1, "take"));
    for _ in 0..5 {
        world.pass(LEASE_TIME - Duration::from_millis(1));
        world.say(&one, &seen);
        world.say(&two, &seen);
    }
    assert_eq!(holder(&mut world, &mut two), Some(("other".into(), false)));
    world.say(&one, &json!({"type": "hidden", "hidden": true}));
    world.pass(LEASE_TIME - Duration::from_millis(1));
    world.say(&one, &seen);
    world.pass_ms(1);
    assert_eq!(holder(&mut world, &mut two), Some(("none".into(), false)));
}

#[test]
fn in_a_replay_nothing_is_ordered() {
    let mut world = World::new(Settings {
        replay: Some(replay()),
        ..settings()
    });
    let mut page = world.page(Some(SECRET), 1);
    let hello = world.of_type(&mut page, "hello");
    assert_eq!(hello[0]["replay"]["file"], "a.mcap");
    world.say(&page, &lease(1, "take"));
    world.say(&page, &order("a", "hold", 0));
    assert_eq!(
        world.of_type(&mut page, "order")[0]["text"],
        "REPLAY: a recording takes no orders"
    );
    world.events();
    let seek = json!({"type": "replay", "action": "seek", "position_s": 5.0, "speed": null});
    world.say(&page, &seek);
    let events = world.events();
    assert!(
        matches!(&events[..], [Event::Replay { request, .. }] if request.position_s == Some(5.0)),
        "{events:?}"
    );
    // Where robots are live there is nothing to seek in.
    let mut world = World::new(settings());
    let page = world.page(Some(SECRET), 1);
    world.events();
    world.say(&page, &seek);
    assert!(world.events().is_empty());
}

#[test]
fn robots_that_come_can_be_chosen() {
    let mut world = world();
    world.server.set_robots(vec![]);
    let mut page = world.page(Some(SECRET), 3);
    assert_eq!(world.of_type(&mut page, "hello")[0]["robots"], json!([]));
    assert!(world.events().is_empty() && world.server.has_viewers());
    world.say(&page, &order("a", "land", 0));
    assert!(world.orders().is_empty());
    world.server.set_robots(vec![3]);
    world.say(&page, &open(None, Some(3)));
    assert_eq!(world.server.watched().collect::<Vec<_>>(), [3]);
    let now = values(3, 1, world.now);
    world.server.now(&now, world.now);
    assert_eq!(world.of_type(&mut page, "now").len(), 1);
}
