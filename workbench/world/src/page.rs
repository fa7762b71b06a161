//! A page in a browser, as the wire sees one: it connects again by itself, draws what comes, says what it has drawn,
//! and sends what is pressed now or never. Its rules are those of the scripts in `gateways/view/page`.

use std::collections::BTreeMap;

use serde_json::{Value, json};

use crate::script::{Dice, Order, What};
use crate::wire;

/// It shows nothing as live that it has not heard of for so long, ms.
const STALE_MS: f64 = 1_500.0;
/// It asks so often whether it is heard, and looks at its clock so often.
const PING_MS: u64 = 1_000;
const TICK_MS: u64 = 250;
/// Its clock stood still.
const GAP_MS: u64 = 1_000;
/// Pauses before it connects again; the last one repeats. An attempt, and a connection that says nothing, end.
const PAUSES_MS: [u64; 5] = [500, 1_000, 2_000, 3_500, 5_000];
const ATTEMPT_MS: u64 = 5_000;
const SILENCE_MS: u64 = 10_000;
/// How far its clock is from all others, ms.
const CLOCK_MS: f64 = 123_456.0;
/// The secret by which it may order.
pub const SECRET: &str = "0123456789abcdef0123456789abcdef";

/// Values that were drawn.
#[derive(Clone, Copy, Debug)]
pub struct Drawn {
    pub n: u64,
    /// By the server's clock, when they were made.
    pub sent_ms: u64,
    pub age_ms: Option<u64>,
    pub position: Option<[f64; 2]>,
}

/// What was pressed.
#[derive(Debug)]
pub struct Press {
    pub number: String,
    /// Where to, degrees, if it is a flight.
    pub place: Option<[f64; 2]>,
    /// When, by the robot's clock.
    pub given_host_ms: u64,
    pub drawn: Option<Drawn>,
    pub message: Option<String>,
    /// As which orders of the judge it was sent to the bridge.
    pub ordered: Vec<usize>,
    /// The instance of the server that it reached.
    pub reached: Option<String>,
    /// Stage of the report that was called the last, and its text.
    pub end: Option<(String, String)>,
    /// Its page was loaded anew, and the connection lost, since: nobody waits for what becomes of it.
    pub is_unheard: bool,
}

/// What a page does at a moment.
#[derive(Default)]
pub struct Said {
    /// Messages on its connection, each later by so many ms than it is said.
    pub texts: Vec<(u64, String)>,
    pub connects: bool,
    pub closes: bool,
    /// What a report of an order broke.
    pub wrong: Option<String>,
}

pub struct Page {
    name: String,
    pub robot: u32,
    pub hangs_until: u64,
    hidden_until: Option<u64>,
    pub is_open: bool,
    pub is_connecting: bool,
    since: u64,
    connects_at: Option<u64>,
    attempt: usize,
    instance: Option<String>,
    pub drawn: Option<Drawn>,
    newest: Option<Drawn>,
    seen: Option<u64>,
    heard: Option<u64>,
    is_alive: bool,
    is_waking: bool,
    awaited: Option<u64>,
    unanswered: Vec<(u64, u64)>,
    pings: u64,
    pinged: u64,
    ticked: u64,
    bounds: Vec<f64>,
    asked: BTreeMap<u64, f64>,
    opened: Option<f64>,
    holder: String,
    took: u64,
    presses_so_far: u64,
    pub presses: Vec<Press>,
    copies: Vec<(u64, String)>,
}

impl Page {
    pub fn new(sender: usize, robot: usize, now_ms: u64) -> Page {
        Page {
            name: format!("page-{sender}"),
            robot: robot as u32 + 1,
            hangs_until: 0,
            hidden_until: None,
            is_open: false,
            is_connecting: false,
            since: 0,
            connects_at: Some(now_ms),
            attempt: 0,
            instance: None,
            drawn: None,
            newest: None,
            seen: None,
            heard: None,
            is_alive: false,
            is_waking: false,
            awaited: None,
            unanswered: Vec::new(),
            pings: 0,
            pinged: 0,
            ticked: now_ms,
            bounds: Vec::new(),
            asked: BTreeMap::new(),
            opened: None,
            holder: String::new(),
            took: 0,
            presses_so_far: 0,
            presses: Vec::new(),
            copies: Vec::new(),
        }
    }

    /// It is loaded again: of what it knew its name is left.
    pub fn reload(&mut self, sender: usize, now_ms: u64) {
        let mut presses = std::mem::take(&mut self.presses);
        presses.iter_mut().for_each(|press| press.is_unheard = true);
        *self = Page {
            presses,
            presses_so_far: self.presses_so_far,
            pings: self.pings,
            ..Page::new(sender, self.robot as usize - 1, now_ms + 300)
        };
    }

    /// Nobody sees it for so long.
    pub fn hides(&mut self, until: u64, said: &mut Said) {
        if self.hidden_until.is_none() {
            self.say(said, &json!({"type": "hidden", "hidden": true}));
        }
        self.hidden_until = Some(until.max(self.hidden_until.unwrap_or(0)));
    }

    pub fn is_hidden(&self) -> bool {
        self.hidden_until.is_some()
    }

    /// Its clock.
    fn clock(now_ms: u64) -> f64 {
        now_ms as f64 + CLOCK_MS
    }

    fn say(&self, said: &mut Said, message: &Value) -> bool {
        if self.is_open {
            said.texts.push((0, message.to_string()));
        }
        self.is_open
    }

    fn ping(&mut self, now_ms: u64, said: &mut Said) -> Option<u64> {
        self.pings += 1;
        self.pinged = now_ms;
        let id = self.pings;
        if !self.say(said, &json!({"type": "ping", "id": id.to_string()})) {
            return None;
        }
        self.asked.insert(id, Page::clock(now_ms));
        self.unanswered.push((id, now_ms));
        Some(id)
    }

    fn wake(&mut self, now_ms: u64, said: &mut Said) {
        self.awaited = self.ping(now_ms, said);
        self.is_waking = true;
    }

    /// The connection is there.
    pub fn opens(&mut self, now_ms: u64, said: &mut Said) {
        (self.is_open, self.is_connecting, self.since) = (true, false, now_ms);
        self.unanswered.clear();
        self.awaited = None;
        self.bounds.clear();
        self.asked.clear();
        self.opened = Some(Page::clock(now_ms));
        self.is_alive = false;
        let open = json!({"type": "open", "token": SECRET, "robot": self.robot, "rate_hz": 20, "page": self.name});
        self.say(said, &open);
        if self.is_hidden() {
            self.say(said, &json!({"type": "hidden", "hidden": true}));
        }
        self.wake(now_ms, said);
    }

    /// The connection has ended.
    pub fn closed(&mut self, now_ms: u64, dice: &mut Dice) {
        (self.is_open, self.is_connecting) = (false, false);
        // A connection takes with it what is on its way.
        self.copies.clear();
        let pause = PAUSES_MS[self.attempt.min(PAUSES_MS.len() - 1)];
        let chance = dice.count(80, 100);
        let pause = if self.attempt == 0 {
            pause
        } else {
            pause * chance / 100
        };
        self.attempt += 1;
        self.connects_at = Some(now_ms + pause);
    }

    /// For how long it was not heard, or has not heard.
    fn silence_ms(&self, now_ms: u64) -> f64 {
        let Some(heard) = self.heard else { return 0.0 };
        let oldest = self.unanswered.first().map_or(u64::MAX, |(_, at)| *at);
        (now_ms - heard.min(oldest)) as f64
    }

    /// Whether it shows what it has drawn as it is now.
    pub fn is_live(&self, now_ms: u64) -> bool {
        self.heard.is_some() && self.silence_ms(now_ms) <= STALE_MS && !self.is_waking
    }

    /// How old what it shows is at most, ms.
    pub fn age_ms(&self, now_ms: u64) -> Option<(Drawn, f64)> {
        let drawn = self.drawn?;
        let age_ms = drawn.age_ms? as f64;
        let most = self.bounds.iter().copied().reduce(f64::max)?;
        let since = (Page::clock(now_ms) - drawn.sent_ms as f64 - most).max(0.0);
        Some((drawn, age_ms + since))
    }

    /// A message has come.
    pub fn take(&mut self, text: &[u8], now_ms: u64, said: &mut Said, dice: &mut Dice) {
        let Ok(message) = serde_json::from_slice::<Value>(text) else {
            said.wrong = Some("a page gets what is no JSON".to_owned());
            return;
        };
        self.since = now_ms;
        self.heard = Some(now_ms);
        let kind = message["type"].as_str().unwrap_or("").to_owned();
        let sent = message["sent_ms"].as_f64();
        if let (Some(opened), Some(server)) = (self.opened, sent) {
            self.bounds.push(opened - server);
            self.opened = None;
        }
        match kind.as_str() {
            "hello" => self.hello(&message),
            "pong" => self.ponged(&message, sent),
            "order" => self.report(&message, said),
            "lease" => self.lease(&message, now_ms, said, dice),
            "now" => {
                let place = |at: usize| message["position"][at].as_f64();
                self.newest = Some(Drawn {
                    n: message["n"].as_u64().unwrap_or(0),
                    sent_ms: message["sent_ms"].as_u64().unwrap_or(0),
                    age_ms: message["telemetry"]["age_ms"].as_u64(),
                    position: place(0).zip(place(1)).map(|(a, b)| [a, b]),
                });
                self.is_alive = true;
            }
            "beat" => self.is_alive = true,
            _ => {}
        }
    }

    fn hello(&mut self, message: &Value) {
        self.attempt = 0;
        let instance = message["instance"].as_str().map(str::to_owned);
        let is_another = self.instance.is_some() && self.instance != instance;
        if self.instance != instance {
            self.seen = None;
        }
        if is_another {
            (self.drawn, self.newest) = (None, None);
        }
        for press in &mut self.presses {
            press.is_unheard |= is_another && press.end.is_none();
        }
        self.instance = instance;
    }

    fn ponged(&mut self, message: &Value, sent: Option<f64>) {
        let id = message["id"].as_str().and_then(|id| id.parse().ok());
        let Some(id) = id else { return };
        if let (Some(asked), Some(server)) = (self.asked.remove(&id), sent) {
            self.bounds.push(asked - server);
            let kept = self.bounds.len().saturating_sub(60);
            self.bounds.drain(..kept);
        }
        let upto = self.unanswered.iter().position(|(other, _)| *other == id);
        self.unanswered.drain(..upto.map_or(0, |at| at + 1));
        if self.awaited == Some(id) {
            self.awaited = None;
        }
    }

    fn lease(&mut self, message: &Value, now_ms: u64, said: &mut Said, dice: &mut Dice) {
        self.holder = message["holder"].as_str().unwrap_or("").to_owned();
        let is_asked = message["asked"].as_bool() == Some(true);
        if self.holder == "you" && is_asked {
            let action = if dice.once_in(2) { "give" } else { "keep" };
            self.act(action, said);
        }
        if self.holder == "none" && now_ms >= self.took + 500 && dice.once_in(2) {
            self.took = now_ms;
            self.act("take", said);
        }
    }

    fn act(&self, action: &str, said: &mut Said) {
        let lease = json!({"type": "lease", "robot": self.robot, "action": action});
        self.say(said, &lease);
    }

    fn report(&mut self, message: &Value, said: &mut Said) {
        let text = |field: &str| message[field].as_str().unwrap_or("").to_owned();
        let number = text("order");
        let Some(press) = self.presses.iter_mut().find(|it| it.number == number) else {
            return;
        };
        let end = (text("stage"), text("text"));
        match &press.end {
            Some(before) if *before != end => {
                said.wrong = Some(format!("a press ended as {before:?}, and then {end:?}"));
            }
            None if message["final"].as_bool() == Some(true) => press.end = Some(end),
            _ => {}
        }
    }

    /// Something is pressed. What is not live is not sent, and never will be.
    pub fn press(
        &mut self,
        order: &Order,
        place: Option<[f64; 2]>,
        now: (u64, u64),
        said: &mut Said,
    ) {
        let (now_ms, host_ms) = now;
        if self.hangs_until > now_ms || self.is_hidden() {
            return;
        }
        self.presses_so_far += 1;
        let number = format!("{}-{}", self.name, self.presses_so_far);
        let kind = match order.what {
            What::Hold => "hold",
            What::Land => "land",
            What::Start => "start",
            What::Stop => "stop",
            What::TakeOff => "takeoff",
            What::Path(_) => "goto",
            What::Write | What::Read => return,
        };
        let is_calm = matches!(order.what, What::Hold | What::Land);
        if !is_calm && self.holder != "you" {
            self.act("take", said);
        }
        let altitude_m = match order.what {
            What::TakeOff => Some(5.0),
            What::Path(_) => Some(0.0),
            _ => None,
        };
        let message = json!({
            "type": "order", "order": number, "robot": self.robot, "kind": kind, "seen": self.seen.unwrap_or(0),
            "position": place, "altitude_m": altitude_m, "confirm": matches!(order.what, What::Stop).then_some("stop"),
        });
        let is_sent = self.is_live(now_ms) && self.is_open;
        let message = is_sent.then(|| message.to_string());
        if let Some(message) = &message {
            said.texts.push((order.late_ms, message.clone()));
            if let Some(copy_ms) = order.copy_ms {
                self.copies.push((now_ms + copy_ms, message.clone()));
            }
        }
        let drawn = self.drawn.filter(|drawn| Some(drawn.n) == self.seen);
        self.presses.push(Press {
            number,
            place,
            given_host_ms: host_ms,
            drawn,
            message,
            ordered: Vec::new(),
            reached: None,
            end: None,
            is_unheard: false,
        });
    }

    /// One step of time.
    pub fn step(&mut self, now_ms: u64, said: &mut Said) {
        if self.hidden_until.is_some_and(|until| until <= now_ms) {
            self.hidden_until = None;
            self.say(said, &json!({"type": "hidden", "hidden": false}));
            self.wake(now_ms, said);
        }
        let is_due = |(at, _): &mut (u64, String)| *at <= now_ms;
        let copies = self.copies.extract_if(.., is_due);
        said.texts.extend(copies.map(|(_, text)| (0, text)));
        if now_ms >= self.ticked + TICK_MS {
            let is_gap = now_ms > self.ticked + TICK_MS + GAP_MS;
            self.ticked = now_ms;
            self.tick(now_ms, is_gap, said);
        }
        if let Some(newest) = self.newest.take() {
            self.drawn = Some(newest);
        }
        if self.is_alive && self.awaited.is_none() {
            self.is_waking = false;
        }
        self.is_alive = false;
        if let Some(Drawn { n, .. }) = self.drawn
            && self.seen != Some(n)
            && self.say(said, &json!({"type": "seen", "n": n}))
        {
            self.seen = Some(n);
        }
        let is_idle = !self.is_open && !self.is_connecting;
        if is_idle && self.connects_at.is_some_and(|at| at <= now_ms) {
            (self.is_connecting, self.since, self.connects_at) = (true, now_ms, None);
            said.connects = true;
        }
    }

    fn tick(&mut self, now_ms: u64, is_gap: bool, said: &mut Said) {
        if self.is_hidden() {
            return;
        }
        if is_gap {
            self.bounds.clear();
            self.opened = None;
            self.wake(now_ms, said);
        }
        if now_ms >= self.pinged + PING_MS {
            self.ping(now_ms, said);
        }
        let most = if self.is_open { SILENCE_MS } else { ATTEMPT_MS };
        if (self.is_open || self.is_connecting) && now_ms > self.since + most {
            said.closes = true;
        }
    }
}

/// The request by which it connects.
pub fn upgrade() -> Vec<u8> {
    wire::upgrade("hero.view.v1")
}
