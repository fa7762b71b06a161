//! The live view of a robot, around the cores that run in flight, and the [pages](Page) that order through it over
//! connections that delay and break. `GivenPress`: what must hold of a press.

use std::collections::{BTreeMap, VecDeque};
use std::time::Duration;

use ipc_types::code::{Reason, Stage};
use ipc_types::payload::{HeroTelemetry, ModuleState, RequestReport, WaypointPosition};
use ipc_types::{MonotonicNs, RobotId};
use operator::config::RequestConfig;
use operator::request::begin_by_ns;
use operator::request::followed::FollowedOrders;
use operator::request::ports::RobotOrder;
use operator::robot::clock::Clocks;
use operator::robot::model::{Process as Watched, WatchedRobot};
use operator::robot::pilot::request_under_way;
use view::orders::{GivenOrder, OrderPort, Orders};
use view::page::{OrderRequest, OrderStage, Role};
use view::speaker::{Speaker, SpokenRobot};
use view::{Event, Instance, LEASE_TIME, Peer, Server, Settings, Token};

use crate::judge::Ordered;
use crate::life::{EPOCH_MS, Life, MS, QUEUE, TICK_MS};
use crate::page::{self, Drawn, Page, Press, SECRET, Said};
use crate::plant::Plant;
use crate::request::Stamp;
use crate::robot::Robot;
use crate::script::{Dice, Order, What};
use crate::wire::{self, Got, Piece, Wire};

/// A movement goes on without a page for so long.
const PAGE_LOST_MS: u64 = 1_500;
/// The robots are looked at so often.
const WATCHED: Duration = Duration::from_millis(50);
const UNWATCHED: Duration = Duration::from_millis(200);
/// What a page has drawn may be so old when it orders a movement by it, ms.
const SEEN_MS: u64 = 2_000;
/// How late the hold of a robot without a page may be, and a calm order that was overtaken may be unknown, ms.
const SLACK_MS: u64 = 600;
/// The processes of views have numbers from here on: a hundred for each robot.
const FIRST_PROCESS: u32 = 30_000;

/// What is there of a robot, and was not taken.
#[derive(Default)]
struct Queues {
    heroes: VecDeque<HeroTelemetry>,
    states: VecDeque<ModuleState>,
    reports: Vec<RequestReport>,
}

/// What the view knows of its robot.
struct Shown {
    watched: WatchedRobot,
    orders: FollowedOrders,
    queues: Queues,
    has_news: bool,
}

/// The live view of a robot, and its pages by their senders.
pub struct ViewProcess {
    pub life: Life,
    pub process: u32,
    plant: Plant,
    count: u32,
    server: Server,
    speaker: Speaker,
    orders: Orders,
    shown: Shown,
    next_look: MonotonicNs,
    pub pages: BTreeMap<usize, Page>,
    outages: BTreeMap<usize, u64>,
    wires: Vec<Wire>,
    dice: Dice,
    /// For how long no page has commanded that could be known of, while the view was awake, ms.
    deserted_ms: u64,
    /// A hold for want of a page was ordered.
    has_held: bool,
}

fn server(robot: usize, instance: &str) -> Server {
    let settings = Settings {
        tokens: vec![Token {
            name: "page".to_owned(),
            role: Role::Command,
            secret: SECRET.to_owned(),
            is_local: false,
        }],
        ..Settings::default()
    };
    let mut server = Server::new(settings, Instance(instance.to_owned()));
    server.set_robots(vec![robot as u32 + 1]);
    server
}

fn shown(robot: usize) -> Shown {
    Shown {
        watched: WatchedRobot::new(RobotId::new(robot as u32 + 1).expect("a robot")),
        orders: FollowedOrders::default(),
        queues: Queues::default(),
        has_news: true,
    }
}

fn orders(plant: Plant) -> Orders {
    let after = Duration::from_millis(PAGE_LOST_MS);
    Orders::new((plant != Plant::ViewNeverHolds).then_some(after))
}

impl ViewProcess {
    pub fn new(
        robot: usize,
        senders: &[usize],
        now_ms: u64,
        seed: u64,
        plant: Plant,
    ) -> ViewProcess {
        let page = |sender: &usize| (*sender, Page::new(*sender, robot, now_ms));
        ViewProcess {
            life: Life::default(),
            process: FIRST_PROCESS + 100 * robot as u32,
            plant,
            count: 0,
            server: server(robot, "0"),
            speaker: Speaker::default(),
            orders: orders(plant),
            shown: shown(robot),
            next_look: MonotonicNs(0),
            pages: senders.iter().map(page).collect(),
            outages: BTreeMap::new(),
            wires: Vec::new(),
            dice: Dice::new(seed, 15 + robot as u64),
            deserted_ms: 0,
            has_held: false,
        }
    }

    fn instance(&self) -> String {
        self.count.to_string()
    }

    /// It is killed: all connections end.
    pub fn dies(&mut self, robot: &Robot, until: u64) {
        self.life.away_until = Some(until);
        self.count += 1;
        self.process += 1;
        self.server = server(robot.index, &self.instance());
        self.speaker = Speaker::default();
        self.orders = orders(self.plant);
        self.shown = shown(robot.index);
        (self.next_look, self.deserted_ms) = (MonotonicNs(0), 0);
        for wire in self.wires.iter_mut().filter(|wire| wire.has_view) {
            wire.has_view = false;
            wire.socket.clear();
            wire.send_down(Piece::End, robot.now_ms, &mut self.dice);
        }
    }

    pub fn report(&mut self, report: RequestReport) {
        self.shown.queues.reports.push(report);
    }

    /// What a robot has published is in the queues of its subscribers.
    pub fn published(&mut self, robot: &Robot) {
        let queues = &mut self.shown.queues;
        queues.heroes.extend(robot.samples.iter().copied());
        queues.states.extend(robot.state);
        let (heroes, states) = (queues.heroes.len(), queues.states.len());
        queues.heroes.drain(..heroes.saturating_sub(QUEUE));
        queues.states.drain(..states.saturating_sub(QUEUE));
    }

    /// Nothing passes to and from a page. Of three such times one is waited for by all, one breaks the connection for
    /// the page alone, and one for both ends.
    pub fn outage(&mut self, sender: usize, now_ms: u64, ms: u64) {
        let until = self.outages.entry(sender).or_default();
        *until = (*until).max(now_ms + ms);
        let page = self.pages.get_mut(&sender).expect("a page");
        if ms.is_multiple_of(3) || !page.is_open && !page.is_connecting {
            return;
        }
        page.closed(now_ms, &mut self.dice);
        for wire in self
            .wires
            .iter_mut()
            .filter(|it| it.sender == sender && it.has_page)
        {
            wire.has_page = false;
            wire.loses_up();
            if ms % 3 == 1 {
                wire.socket.push_back(Piece::End);
            }
        }
    }

    /// A page is loaded again.
    pub fn reload(&mut self, sender: usize, now_ms: u64) {
        let page = self.pages.get_mut(&sender).expect("a page");
        page.reload(sender, now_ms);
        for wire in self
            .wires
            .iter_mut()
            .filter(|it| it.sender == sender && it.has_page)
        {
            wire.has_page = false;
            wire.send_up(Piece::End, now_ms, &mut self.dice);
        }
    }

    /// A page stands still, or, every other time, is not seen.
    pub fn hangs(&mut self, sender: usize, now_ms: u64, ms: u64) {
        let mut said = Said::default();
        let page = self.pages.get_mut(&sender).expect("a page");
        match ms % 2 {
            0 => page.hangs_until = page.hangs_until.max(now_ms + ms),
            _ if page.hangs_until <= now_ms => page.hides(now_ms + ms, &mut said),
            _ => {}
        }
        self.carry(sender, said, now_ms);
    }

    /// The operator at a page orders something.
    pub fn order(&mut self, order: &Order, robot: &Robot) {
        let place = match &order.what {
            What::Path(places) => {
                let at = robot.waypoint(0, 0, places[0]);
                Some([at.latitude_deg, at.longitude_deg])
            }
            _ => None,
        };
        let mut said = Said::default();
        let now = (robot.now_ms, robot.host().0 / MS);
        let page = self.pages.get_mut(&order.sender).expect("a page");
        page.press(order, place, now, &mut said);
        self.carry(order.sender, said, robot.now_ms);
    }

    /// What a page says goes on its connection.
    fn carry(&mut self, sender: usize, said: Said, now_ms: u64) {
        let dice = &mut self.dice;
        if said.connects {
            let mut wire = Wire::new(sender);
            wire.send_up(Piece::Bytes(page::upgrade()), now_ms, dice);
            self.wires.push(wire);
        }
        let mut wires = self.wires.iter_mut();
        let wire = wires.find(|it| it.sender == sender && it.has_page);
        let Some(wire) = wire else { return };
        for (late_ms, text) in said.texts {
            wire.send_up(Piece::Bytes(wire::text(&text)), now_ms + late_ms, dice);
        }
        if said.closes {
            wire.has_page = false;
            wire.send_up(Piece::End, now_ms, dice);
            let page = self.pages.get_mut(&sender).expect("a page");
            page.closed(now_ms, dice);
        }
    }

    /// What passes between the pages and the machine, and what the pages do.
    pub fn run_pages(&mut self, robot: &mut Robot) {
        let now_ms = robot.now_ms;
        for index in 0..self.wires.len() {
            self.run_wire(index, robot);
        }
        self.wires.retain(|wire| wire.has_page || wire.has_view);
        for sender in self.pages.keys().copied().collect::<Vec<_>>() {
            let page = self.pages.get_mut(&sender).expect("a page");
            if page.hangs_until > now_ms {
                continue;
            }
            let mut said = Said::default();
            page.step(now_ms, &mut said);
            if page.is_live(now_ms)
                && let Some((drawn, age_ms)) = page.age_ms(now_ms)
            {
                judge_drawn(&drawn, age_ms, robot);
            }
            self.carry(sender, said, now_ms);
        }
    }

    fn run_wire(&mut self, index: usize, robot: &mut Robot) {
        let now_ms = robot.now_ms;
        let wire = &mut self.wires[index];
        let sender = wire.sender;
        if self
            .outages
            .get(&sender)
            .is_some_and(|until| *until > now_ms)
        {
            return;
        }
        if !robot.is_asleep() {
            wire.arrive(now_ms);
        }
        if !self.life.is_up() && wire.has_view && !wire.socket.is_empty() {
            wire.socket.clear();
            wire.has_view = false;
            wire.send_down(Piece::End, now_ms, &mut self.dice);
        }
        let page = self.pages.get_mut(&sender).expect("a page");
        let hangs = page.hangs_until > now_ms;
        if hangs && wire.has_page {
            return;
        }
        let mut said = Said::default();
        for got in wire.take(now_ms) {
            if !wire.has_page {
                continue;
            }
            match got {
                Got::Upgraded => page.opens(now_ms, &mut said),
                Got::Text(text) => page.take(&text, now_ms, &mut said, &mut self.dice),
                Got::Ping => wire.send_up(Piece::Bytes(wire::pong()), now_ms, &mut self.dice),
                Got::End => {
                    wire.has_page = false;
                    page.closed(now_ms, &mut self.dice);
                }
            }
        }
        if let Some(what) = said.wrong.take() {
            robot.judge.fail(what);
        }
        self.carry(sender, said, now_ms);
    }

    /// It is awake: takes what has come, and does what is due.
    pub fn step(&mut self, robot: &mut Robot, next_id: &mut u64) {
        self.watch_over(robot);
        let now = robot.host();
        let has_come = self
            .wires
            .iter()
            .any(|wire| wire.has_view && !wire.socket.is_empty());
        let due = [
            Some(self.next_look),
            self.server.deadline(),
            self.shown.orders.next(),
        ];
        let is_due = due.into_iter().flatten().any(|due| due <= now);
        if !has_come && !is_due && self.shown.queues.reports.is_empty() {
            return;
        }
        self.take_bytes(robot);
        self.server.advance(now);
        for _ in 0..4 {
            let wanted = self.take_events(robot, next_id);
            self.look(robot, next_id);
            self.send(robot);
            if !wanted {
                break;
            }
        }
    }

    fn take_bytes(&mut self, robot: &Robot) {
        let now = robot.host();
        for wire in self.wires.iter_mut().filter(|wire| wire.has_view) {
            while let Some(piece) = wire.socket.pop_front() {
                if wire.id.is_none() {
                    let peer = Peer {
                        address: ([127, 0, 0, 1], 40_000 + wire.sender as u16).into(),
                        at: [127, 0, 0, 1].into(),
                        is_own_user: true,
                        is_encrypted: false,
                    };
                    wire.id = self.server.accept(peer, now);
                }
                let Some(id) = wire.id else { break };
                wire.read_ms = robot.now_ms;
                match piece {
                    Piece::Bytes(bytes) => {
                        let text = wire::text_of(&bytes).unwrap_or("").to_owned();
                        if let Some(rest) = text.split("\"hidden\":").nth(1) {
                            wire.is_hidden = rest.starts_with("true");
                        }
                        let page = self.pages.get_mut(&wire.sender).expect("a page");
                        let mut presses = page.presses.iter_mut();
                        let is_copy = match presses.find(|it| it.message.as_ref() == Some(&text)) {
                            Some(press) => press.reached.replace(self.count.to_string()).is_some(),
                            None => false,
                        };
                        let bytes = match self.plant {
                            Plant::ViewTakesCopies if is_copy => wire::text(
                                &text.replace("\"order\":\"page", "\"order\":\"copy-page"),
                            ),
                            Plant::ViewForgetsSeen if text.contains("\"seen\":") => {
                                let newest = page.drawn.map_or(0, |drawn| drawn.n);
                                wire::text(&with_seen(&text, newest))
                            }
                            _ => bytes,
                        };
                        self.server.receive(id, &bytes, now);
                    }
                    Piece::End => {
                        self.server.closed(id, now);
                        wire.has_view = false;
                    }
                }
            }
        }
    }

    fn take_events(&mut self, robot: &mut Robot, next_id: &mut u64) -> bool {
        let now = robot.host();
        let mut wanted = false;
        while let Some(event) = self.server.poll_event() {
            wanted = true;
            match event {
                Event::Joined { robot: joined, .. } => {
                    self.speaker.joined(joined);
                    self.next_look = now;
                    self.look(robot, next_id);
                }
                Event::Order {
                    order,
                    issued,
                    from,
                    ..
                } => {
                    let issued = match self.plant {
                        Plant::ViewStamps => now,
                        Plant::ViewStampsCalm if order.kind.is_everyones() => now,
                        _ => issued,
                    };
                    self.ordered(&order, issued, &from, (robot, next_id));
                }
                _ => {}
            }
        }
        wanted
    }

    fn ordered(
        &mut self,
        order: &OrderRequest,
        issued: MonotonicNs,
        from: &str,
        (robot, next_id): (&mut Robot, &mut u64),
    ) {
        let number = order.order.trim_start_matches("copy-");
        let presses = self.pages.values_mut().flat_map(|page| &mut page.presses);
        let press = { presses }.find(|press| press.number == number);
        let Some(press) = press else {
            return robot
                .judge
                .fail("an order that no page has given".to_owned());
        };
        let now = robot.host();
        let config = RequestConfig::default();
        let given = GivenOrder {
            order,
            issued,
            from,
        };
        let mut port = Port {
            shown: &mut self.shown,
            robot,
            next_id,
            process: self.process,
            press: Some(press),
        };
        let report = self.orders.take(&given, &mut port, &config, now);
        self.server.order(&report);
    }

    /// Looks at the robot when it is time to, and says what is new.
    fn look(&mut self, robot: &mut Robot, next_id: &mut u64) {
        let now = robot.host();
        if now >= self.next_look {
            let period = if self.server.has_viewers() {
                WATCHED
            } else {
                UNWATCHED
            };
            self.next_look = (self.next_look + period).max(now + period / 2);
            self.server.set_wall_clock(0);
            self.shown.drain(self.plant, now);
            self.shown.look(robot, now);
            self.shown.watched.judge(now);
            self.hold_deserted(robot, next_id);
            let clock = Clocks {
                now,
                zero_unix_ns: 0,
            };
            let seen = SpokenRobot {
                robot: &self.shown.watched,
                has_news: self.shown.has_news,
            };
            self.speaker
                .speak([seen].into_iter(), &mut self.server, clock, now);
        }
        self.say_reports(robot, now);
    }

    fn hold_deserted(&mut self, robot: &mut Robot, next_id: &mut u64) {
        let now = robot.host();
        let (server, plant) = (&self.server, self.plant);
        let state = self.shown.watched.state.as_ref();
        let under_way = (robot.index as u32 + 1, state.and_then(request_under_way));
        let is_commanded = |id| server.is_commanded(id) && plant != Plant::ViewIsDeserted;
        let due = self
            .orders
            .deserted([under_way].into_iter(), is_commanded, now);
        if due.is_empty() {
            return;
        }
        let limit_ms = LEASE_TIME.as_millis() as u64;
        let is_there = |wire: &&Wire| {
            let is_heard = robot.now_ms < wire.read_ms + limit_ms;
            wire.has_view && wire.commands && !wire.is_hidden && is_heard
        };
        if let Some(wire) = self.wires.iter().find(is_there) {
            let text = format!(
                "it holds for want of a page, and sender {} commands",
                wire.sender
            );
            robot.judge.fail(text);
        }
        robot.judge.ran.page_holds += 1;
        self.has_held = true;
        let config = RequestConfig::default();
        let mut port = Port {
            shown: &mut self.shown,
            robot,
            next_id,
            process: self.process,
            press: None,
        };
        if port.send(RobotOrder::Hold, now, &config, now).is_ok() {
            self.orders.note_held(robot.index as u32 + 1);
        }
    }

    fn say_reports(&mut self, robot: &mut Robot, now: MonotonicNs) {
        self.shown.take_reports(now);
        for news in self.shown.orders.take_news().collect::<Vec<_>>() {
            let Some(mut report) = self.orders.report(robot.index as u32 + 1, &news) else {
                continue;
            };
            match self.plant {
                Plant::ViewSaysNothing if report.is_final && news.request_id.is_multiple_of(2) => {
                    continue;
                }
                Plant::ViewInvents if report.stage == OrderStage::Replaced => {
                    report.stage = OrderStage::Done;
                }
                _ => {}
            }
            let mut presses = self.pages.values().flat_map(|page| &page.presses);
            let press = presses.find(|press| press.number == report.order);
            if let Some(press) = press.filter(|_| report.is_final) {
                judge_end(press, report.stage, robot);
            }
            self.server.order(&report);
            if self.plant == Plant::ViewSaysTwice && report.is_final {
                report.text.push_str(", and so on");
                self.server.order(&report);
            }
        }
    }

    /// Writes what waits, and closes what has ended.
    fn send(&mut self, robot: &Robot) {
        let now = robot.host();
        for wire in self.wires.iter_mut().filter(|wire| wire.has_view) {
            let Some(id) = wire.id else { continue };
            let waits = loop {
                let room = wire.room();
                let output = self.server.output(id);
                let count = output.len().min(room);
                if output.is_empty() || count == 0 {
                    break !output.is_empty();
                }
                let bytes = output[..count].to_vec();
                if let Some(holder) = holder_in(&bytes) {
                    wire.commands = holder;
                }
                wire.send_down(Piece::Bytes(bytes), robot.now_ms, &mut self.dice);
                self.server.sent(id, count, now);
            };
            if !waits && self.server.is_ended(id) {
                self.server.closed(id, now);
                wire.has_view = false;
                wire.send_down(Piece::End, robot.now_ms, &mut self.dice);
            }
        }
    }

    /// A movement of a page does not go on for longer than it may without one that can command.
    fn watch_over(&mut self, robot: &mut Robot) {
        let limit_ms = LEASE_TIME.as_millis() as u64;
        let is_there = |wire: &Wire| wire.has_view && robot.now_ms < wire.read_ms + limit_ms;
        let is_followed = robot.judge.follows_of(self.process);
        match !is_followed || self.wires.iter().any(is_there) {
            true => (self.deserted_ms, self.has_held) = (0, false),
            false => self.deserted_ms += TICK_MS,
        }
        let most_ms = PAGE_LOST_MS + SLACK_MS;
        if self.deserted_ms > most_ms && !self.has_held && robot.judge.is_calm() {
            let text =
                format!("a page's movement goes on {most_ms} ms after the last page was gone");
            robot.judge.fail(text);
        }
    }

    /// Everything is well from now on.
    pub fn heal(&mut self) {
        self.life.away_until = self.life.away_until.map(|_| 0);
        self.life.stalls_until = 0;
        self.outages.clear();
        for page in self.pages.values_mut() {
            page.hangs_until = 0;
        }
    }

    /// The presses whose end a page that is there waits for.
    fn waiting(&self) -> impl Iterator<Item = &Press> {
        let instance = self.instance();
        let presses = self.pages.values().flat_map(|page| &page.presses);
        presses.filter(move |press| {
            let is_known = press.reached.as_ref() == Some(&instance);
            press.end.is_none() && !press.is_unheard && is_known
        })
    }

    pub fn has_waiting(&self) -> bool {
        self.waiting().next().is_some()
    }

    /// Everything has come to its end.
    pub fn all_told(&self, robot: &mut Robot) {
        let open = self
            .waiting()
            .next()
            .map(|press| format!("{press:?} has no final report"));
        if let Some(open) = open {
            robot.judge.fail(open);
        }
        let presses = self.pages.values().flat_map(|page| &page.presses);
        for press in presses {
            robot.judge.ran.presses += 1;
            robot.judge.ran.page_ends += u64::from(press.end.is_some());
        }
    }
}

impl Shown {
    fn drain(&mut self, plant: Plant, now: MonotonicNs) {
        self.has_news = !self.queues.states.is_empty() || !self.queues.heroes.is_empty();
        for state in std::mem::take(&mut self.queues.states) {
            self.watched.state(&state, now);
        }
        for mut hero in std::mem::take(&mut self.queues.heroes) {
            match plant {
                Plant::ViewPlace => hero.geodetic.latitude_rad += 1e-6,
                Plant::ViewKeepsYoung => hero.received_ns = now.0,
                _ => {}
            }
            self.watched.hero(&hero, now);
        }
    }

    fn look(&mut self, robot: &Robot, now: MonotonicNs) {
        for process in self.watched.looks_due(now).collect::<Vec<_>>() {
            let lives = match process {
                Watched::Bridge => robot.bridge_life.is_up(),
                Watched::Status => robot.status_life.is_up(),
                Watched::Relay => false,
            };
            self.watched.provider(process, lives, now);
        }
    }

    fn take_reports(&mut self, now: MonotonicNs) {
        let reports = std::mem::take(&mut self.queues.reports);
        self.orders.take(&reports, &mut self.watched, now);
    }
}

/// A robot as the orders of pages need it.
struct Port<'a> {
    shown: &'a mut Shown,
    robot: &'a mut Robot,
    next_id: &'a mut u64,
    process: u32,
    /// `None` for an order of the view itself.
    press: Option<&'a mut Press>,
}

impl OrderPort for Port<'_> {
    fn robot(&self) -> &WatchedRobot {
        &self.shown.watched
    }

    fn drain(&mut self, now: MonotonicNs) {
        self.shown.drain(Plant::Nothing, now);
        self.shown.take_reports(now);
    }

    fn refusal(&self, _: WaypointPosition, _: MonotonicNs) -> Option<String> {
        // The fence is the bridge's.
        None
    }

    fn send(
        &mut self,
        order: RobotOrder,
        issued: MonotonicNs,
        config: &RequestConfig,
        now: MonotonicNs,
    ) -> Result<u64, String> {
        self.shown.orders.room(order.verb())?;
        let robot = &mut *self.robot;
        if !robot.bridge_life.is_up() {
            return Err("no bridge runs".to_owned());
        }
        let what = match order {
            RobotOrder::Hold => What::Hold,
            RobotOrder::Land => What::Land,
            RobotOrder::Start => What::Start,
            RobotOrder::Stop => What::Stop,
            RobotOrder::TakeOff(_) => What::TakeOff,
            RobotOrder::GoTo(_) => What::Path(vec![(0.0, 0.0)]),
            RobotOrder::TakeControl | RobotOrder::ReleaseControl => return Err("no".to_owned()),
        };
        let number = robot.judge.orders.len();
        let mut requests = robot.requests(&what, *self.next_id);
        *self.next_id += requests.len() as u64;
        if let RobotOrder::GoTo(position) = order {
            robot.go_to(&mut requests, &[position]);
        }
        let begin_by = match begin_by_ns(issued.0, config.deadline_ms) {
            0 => None,
            by => Some(MonotonicNs(by)),
        };
        let request = requests[0].stamped(Stamp {
            issued,
            begin_by,
            after: 0,
        });
        let true_ms = robot.judge.true_ms_of(issued);
        robot.judge.ordered(Ordered {
            order: Order::at_once(usize::MAX, robot.index, what),
            ids: vec![request.id()],
            true_ms,
            issued_ms: true_ms,
            begin_by_ms: begin_by.map(|by| true_ms + (by.0 - issued.0) / MS),
            process: self.process,
            ..Ordered::default()
        });
        if let Some(press) = &mut self.press {
            press.ordered.push(number);
            judge_press(press, order, (issued, begin_by), robot);
        }
        robot.send(robot.now_ms, number, self.process, request);
        Ok(self
            .shown
            .orders
            .begin(request.id(), order.verb(), config, now))
    }
}

/// A press becomes an order: once, as old as it is, and not when it has waited for too long.
fn judge_press(
    press: &Press,
    order: RobotOrder,
    (issued, begin_by): (MonotonicNs, Option<MonotonicNs>),
    robot: &mut Robot,
) {
    let now_ms = robot.host().0 / MS;
    let issued_ms = issued.0 / MS;
    let number = &press.number;
    let is_calm = matches!(order, RobotOrder::Hold | RobotOrder::Land);
    let is_old = now_ms > issued_ms + SEEN_MS;
    let drawn_ms = press.drawn.map(|drawn| drawn.sent_ms);
    let what = if press.ordered.len() > 1 {
        format!("press {number} is ordered twice")
    } else if issued_ms > press.given_host_ms {
        format!(
            "press {number} of {} ms becomes an order of {issued_ms} ms",
            press.given_host_ms
        )
    } else if !is_calm && drawn_ms.is_none_or(|drawn_ms| now_ms > drawn_ms + SEEN_MS) {
        format!("press {number} orders a movement by what was drawn at {drawn_ms:?} ms")
    } else if !is_calm && drawn_ms != Some(issued_ms) {
        format!(
            "press {number} is of {issued_ms} ms, and its page had drawn what is of {drawn_ms:?} ms"
        )
    } else if is_calm && begin_by.is_none() {
        format!("press {number} may begin at any time")
    } else if is_calm
        && is_old
        && robot
            .judge
            .was_overtaken(issued_ms - EPOCH_MS, now_ms - EPOCH_MS - SLACK_MS)
    {
        format!("press {number} has waited, and is carried out over what was ordered since")
    } else if let RobotOrder::GoTo(to) = order
        && !press
            .place
            .is_some_and(|place| is_near(place, [to.latitude_deg, to.longitude_deg]))
    {
        format!("press {number} goes to {to:?}")
    } else {
        return;
    };
    robot.judge.fail(what);
}

/// Whether two places are the same, but for how JSON writes them.
fn is_near(one: [f64; 2], other: [f64; 2]) -> bool {
    (0..2).all(|at| (one[at] - other[at]).abs() < 1e-9)
}

/// What a page is told in the end is what the bridge said.
fn judge_end(press: &Press, stage: OrderStage, robot: &mut Robot) {
    let said = |stage: Stage, reason: Option<Reason>| {
        let mut orders = press.ordered.iter();
        orders.any(|order| robot.judge.has_ended(*order, stage, reason))
    };
    let is_true = match stage {
        OrderStage::Done => said(Stage::Done, None),
        OrderStage::Refused => said(Stage::Refused, None),
        OrderStage::Aborted => said(Stage::Aborted, None),
        OrderStage::Replaced => {
            said(Stage::Aborted, Some(Reason::Replaced))
                || said(Stage::Aborted, Some(Reason::PathReplaced))
        }
        OrderStage::NotSent => press.ordered.is_empty(),
        _ => true,
    };
    if !is_true {
        let text = format!(
            "press {} is told {stage:?}, which nobody said",
            press.number
        );
        robot.judge.fail(text);
    }
}

/// What a page shows as it is now was so, and is as old as it says at most.
fn judge_drawn(drawn: &Drawn, age_ms: f64, robot: &mut Robot) {
    let Some(then_ms) = drawn
        .age_ms
        .map(|age_ms| drawn.sent_ms.saturating_sub(age_ms))
    else {
        return;
    };
    robot.judge.ran.drawn += 1;
    let judged = robot
        .truth
        .judge_drawn(then_ms, drawn.position, age_ms, robot.host());
    if let Err(what) = judged {
        robot.judge.fail(what);
    }
}

/// Which page commands, as messages of the server say; `None` if they do not say it.
fn holder_in(bytes: &[u8]) -> Option<bool> {
    const LEASE: &[u8] = b"\"type\":\"lease\"";
    const YOU: &[u8] = b"\"holder\":\"you\"";
    let find = |text: &[u8], bytes: &[u8]| bytes.windows(text.len()).rposition(|it| it == text);
    let at = find(LEASE, bytes)?;
    let end = bytes[at..].iter().position(|byte| *byte == b'}')?;
    Some(find(YOU, &bytes[at..at + end]).is_some())
}

/// An order that says that its page has drawn this.
fn with_seen(text: &str, newest: u64) -> String {
    let Some(at) = text.find("\"seen\":") else {
        return text.to_owned();
    };
    let at = at + "\"seen\":".len();
    let digits = text[at..].bytes().take_while(u8::is_ascii_digit).count();
    format!("{}{newest}{}", &text[..at], &text[at + digits..])
}
