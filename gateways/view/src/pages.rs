//! [`Pages`]: all connected pages: what each may do and looks at, what waits for it, and which one commands.

use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;
use std::time::Duration;

use ipc_types::MonotonicNs;

use crate::authority::access::Access;
use crate::authority::lease::{Act, Lease};
use crate::authority::orders::{OrderBook, is_number};
use crate::event::{Event, Events, Peer, ViewerId};
use crate::outbox::{NowText, Outbox};
use crate::pace::{ORDERS_PER_S, RateLimit};
use crate::page::{
    self, CheckRequest, Incoming, LeaseAction, OpenRequest, OrderRequest, OrderStage, Outgoing,
};
use crate::viewer::{
    ConnectedPage, Greeting, ONLY_LOOKS, OTHER_ROBOT, REPLAYED, lease_message, millis, refusal,
};
use crate::websocket::Close;

/// How often pages get a sign that there is contact.
pub const BEAT_PERIOD: Duration = Duration::from_millis(500);

/// How long a page may take to say what it wants.
pub const OPEN_TIME: Duration = Duration::from_secs(5);

/// Most characters of what a page calls a ping.
const MAX_PING_ID: usize = 64;

/// All connected pages, and which one commands.
#[derive(Debug)]
pub(crate) struct Pages {
    greeting: Greeting,
    pages: BTreeMap<ViewerId, ConnectedPage>,
    /// The robots that are shown.
    robots: Vec<u32>,
    /// Of each robot that a page commands.
    leases: BTreeMap<u32, Lease>,
    /// Of each robot that no page commands: the page that did before it was gone, silent or hidden. It commands again
    /// when it is back.
    deserted: BTreeMap<u32, String>,
    orders: OrderBook,
    next_beat: MonotonicNs,
    /// The wall clock when the monotonic one was 0, ns since 1970-01-01 UTC; `None` if it is not known.
    zero_unix_ns: Option<u64>,
}

impl Pages {
    pub fn new(greeting: Greeting) -> Pages {
        Pages {
            greeting,
            pages: BTreeMap::new(),
            robots: Vec::new(),
            leases: BTreeMap::new(),
            deserted: BTreeMap::new(),
            orders: OrderBook::default(),
            next_beat: MonotonicNs(0),
            zero_unix_ns: None,
        }
    }

    /// What the wall clock said when the monotonic one was 0, ns since 1970-01-01 UTC.
    pub fn set_wall_clock(&mut self, zero_unix_ns: u64) {
        self.zero_unix_ns = Some(zero_unix_ns);
    }

    pub fn build(&self) -> &str {
        &self.greeting.build
    }

    /// A page has connected.
    pub fn connect(&mut self, viewer: ViewerId, peer: Peer, now: MonotonicNs) {
        if self.pages.is_empty() {
            self.next_beat = now + BEAT_PERIOD;
        }
        let page = ConnectedPage {
            peer,
            connected: now,
            permit: None,
            name: None,
            robot: None,
            looks_since: now,
            is_hidden: false,
            has_joined: false,
            orders: RateLimit::new(ORDERS_PER_S),
            outbox: Outbox::default(),
        };
        self.pages.insert(viewer, page);
    }

    /// A page is gone.
    pub fn leave(&mut self, viewer: ViewerId, now: MonotonicNs, events: &mut Events) {
        self.look_away(viewer, now, events);
        self.pages.remove(&viewer);
    }

    /// A page looks at its robot no more. Gives the robot.
    fn look_away(
        &mut self,
        viewer: ViewerId,
        now: MonotonicNs,
        events: &mut Events,
    ) -> Option<u32> {
        let page = self.pages.get_mut(&viewer)?;
        page.has_joined = false;
        let robot = page.robot.take()?;
        self.act(robot, Act::Gone(viewer), now, events);
        Some(robot)
    }

    /// A page is back at `robot`: if it commanded and no other page has since, it commands again. Its former connection
    /// may be one of which the end is not known here.
    fn come_back(&mut self, viewer: ViewerId, robot: u32, now: MonotonicNs, events: &mut Events) {
        let Some(page) = self.pages.get(&viewer).filter(|page| page.may_order()) else {
            return;
        };
        let Some(name) = page.name.clone() else {
            return;
        };
        let holder = self.leases.get(&robot).and_then(|lease| lease.holder());
        let former = holder.filter(|holder| *holder != viewer);
        if let Some(former) = former
            && self
                .pages
                .get(&former)
                .is_some_and(|page| page.name.as_ref() == Some(&name))
        {
            self.act(robot, Act::Gone(former), now, events);
        }
        if self.deserted.get(&robot) == Some(&name) {
            self.act(robot, Act::Want(viewer, LeaseAction::Take), now, events);
        }
    }

    /// Takes a message of a page. An error ends its connection.
    pub fn take(
        &mut self,
        viewer: ViewerId,
        text: &str,
        access: &Access,
        now: MonotonicNs,
        events: &mut Events,
    ) -> Result<(), Close> {
        let message: Incoming = serde_json::from_str(text).map_err(|_| Close::MEANING)?;
        let Some(page) = self.pages.get_mut(&viewer) else {
            return Ok(());
        };
        if page.permit.is_none() && !matches!(message, Incoming::Open(_)) {
            return Err(Close::MEANING);
        }
        if let Some(robot) = page.robot.filter(|_| !page.is_hidden) {
            self.act(robot, Act::Sign(viewer), now, events);
        }
        match message {
            Incoming::Open(open) => return self.open(viewer, open, access, now, events),
            Incoming::Order(order) => return self.order(viewer, order, now, events),
            Incoming::Check(check) => return self.ask(viewer, check, now, events),
            Incoming::Lease { robot, action } => self.lease(viewer, robot, action, now, events),
            other => {
                let is_shown = matches!(other, Incoming::Hidden { hidden: false });
                let robot = self.pages.get(&viewer).and_then(|page| page.robot);
                self.small(viewer, other, now, events)?;
                if let Some(robot) = robot.filter(|_| is_shown) {
                    self.come_back(viewer, robot, now, events);
                }
            }
        }
        Ok(())
    }

    /// Messages that only concern the page itself.
    fn small(
        &mut self,
        viewer: ViewerId,
        message: Incoming,
        now: MonotonicNs,
        events: &mut Events,
    ) -> Result<(), Close> {
        let has_replay = self.greeting.replay.is_some();
        let Some(page) = self.pages.get_mut(&viewer) else {
            return Ok(());
        };
        match message {
            Incoming::Seen { n } => page.outbox.seen(n, now),
            Incoming::Hidden { hidden } => {
                // What was missed meanwhile comes as a whole.
                page.has_joined |= page.is_hidden && !hidden && page.robot.is_some();
                page.is_hidden = hidden;
                page.outbox.drop_now();
            }
            Incoming::Ping { id } if id.len() <= MAX_PING_ID => {
                let sent_ms = millis(now);
                page.send(&Outgoing::Pong { id: &id, sent_ms });
            }
            Incoming::Ping { .. } => return Err(Close::MEANING),
            Incoming::Replay(request) if has_replay => {
                events.push_back(Event::Replay { viewer, request })
            }
            _ => {}
        }
        Ok(())
    }

    fn open(
        &mut self,
        viewer: ViewerId,
        open: OpenRequest,
        access: &Access,
        now: MonotonicNs,
        events: &mut Events,
    ) -> Result<(), Close> {
        let Some(page) = self.pages.get_mut(&viewer) else {
            return Ok(());
        };
        if open.page.as_deref().is_some_and(|name| !is_number(name)) {
            return Err(Close::MEANING);
        }
        page.outbox.set_rate(open.rate_hz);
        if page.permit.is_none() {
            let Some(permit) = access.permit(&page.peer, open.token.as_deref()) else {
                let text = "this address needs a token: open the page with `ril view`";
                page.send(&Outgoing::Refused { text });
                return Err(Close::TOKEN);
            };
            let is_free = access.permit(&page.peer, None).is_some();
            let hello = self.greeting.hello(permit.role, is_free, &self.robots);
            page.permit = Some(permit);
            page.name = open.page;
            page.send(&Outgoing::Hello(&hello));
        }
        let known = open.robot.filter(|robot| self.robots.contains(robot));
        let robot = known.or_else(|| self.robots.first().copied());
        if page.robot != robot {
            // A page that chooses another robot does not come back to this one.
            if let Some(left) = self.look_away(viewer, now, events) {
                self.deserted.remove(&left);
            }
            if let Some(robot) = robot.filter(|_| self.greeting.replay.is_none()) {
                self.come_back(viewer, robot, now, events);
            }
        }
        self.look_at(viewer, robot, now);
        Ok(())
    }

    /// A page begins to look at `robot`, or gets all of it anew.
    fn look_at(&mut self, viewer: ViewerId, robot: Option<u32>, now: MonotonicNs) {
        let lease =
            robot.map(|robot| (robot, self.leases.get(&robot).copied().unwrap_or_default()));
        let Some(page) = self.pages.get_mut(&viewer) else {
            return;
        };
        let is_another = page.robot != robot;
        if is_another {
            page.looks_since = now;
        }
        page.robot = robot;
        page.outbox.restart_now(is_another);
        let Some((robot, lease)) = lease else {
            return;
        };
        page.has_joined = true;
        page.send(&Outgoing::Lease(&lease_message(robot, lease, viewer, now)));
        for report in self.orders.shown(robot, now) {
            page.send(&Outgoing::Order(report));
        }
    }

    /// Judges an order of a page.
    fn order(
        &mut self,
        viewer: ViewerId,
        order: OrderRequest,
        now: MonotonicNs,
        events: &mut Events,
    ) -> Result<(), Close> {
        if !is_number(&order.order) {
            return Err(Close::MEANING);
        }
        let lease = self.leases.get(&order.robot).copied().unwrap_or_default();
        let Some(page) = self.pages.get_mut(&viewer) else {
            return Ok(());
        };
        if let Some(report) = self.orders.find(&order.order) {
            page.send(&Outgoing::Order(report));
            return Ok(());
        }
        let is_replay = self.greeting.replay.is_some();
        let is_too_fast = !page.orders.allows(now);
        let refusal = match is_too_fast {
            true => Some("more than five orders in a second"),
            false => refusal(page, viewer, &order, lease, is_replay, now),
        };
        let from = page.from();
        let Some(text) = refusal else {
            let issued = page.issued(order.seen);
            self.orders.begin(&order, OrderStage::Sent, "", now);
            events.push_back(Event::Order {
                viewer,
                order,
                issued,
                from,
            });
            return Ok(());
        };
        // What a page that may not order says is not remembered: its numbers must not push out those of others.
        if page.may_order() {
            let report = self.orders.begin(&order, OrderStage::NotSent, text, now);
            page.send(&Outgoing::Order(report));
        } else {
            let report = OrderBook::default()
                .begin(&order, OrderStage::NotSent, text, now)
                .clone();
            page.send(&Outgoing::Order(&report));
        }
        // Those that come too fast would fill the log.
        if !is_too_fast {
            let text = text.to_owned();
            events.push_back(Event::NotSent { order, from, text });
        }
        Ok(())
    }

    /// Takes a question before an order. Only those that may order may ask: an answer can cost a process.
    fn ask(
        &mut self,
        viewer: ViewerId,
        check: CheckRequest,
        now: MonotonicNs,
        events: &mut Events,
    ) -> Result<(), Close> {
        if !is_number(&check.order) {
            return Err(Close::MEANING);
        }
        let Some(page) = self.pages.get_mut(&viewer) else {
            return Ok(());
        };
        let refusal = if self.greeting.replay.is_some() {
            REPLAYED
        } else if !page.may_order() {
            ONLY_LOOKS
        } else if page.robot != Some(check.robot) {
            OTHER_ROBOT
        } else if !page.orders.allows(now) {
            "more than five questions in a second"
        } else {
            events.push_back(Event::Check { viewer, check });
            return Ok(());
        };
        let severity = page::Severity::Alarm;
        let finding = page::Finding {
            severity,
            text: refusal.to_owned(),
            next_step: None,
        };
        page.send(&Outgoing::Check(&page::CheckResult {
            order: check.order,
            robot: check.robot,
            severity,
            findings: vec![finding],
            distance_m: None,
            duration_s: None,
        }));
        Ok(())
    }

    fn lease(
        &mut self,
        viewer: ViewerId,
        robot: u32,
        action: LeaseAction,
        now: MonotonicNs,
        events: &mut Events,
    ) {
        let page = self.pages.get(&viewer);
        let may = page.is_some_and(|page| page.may_order() && page.robot == Some(robot));
        if may && self.greeting.replay.is_none() {
            self.act(robot, Act::Want(viewer, action), now, events);
            // A page that asked in vain is to see that, too.
            self.say_lease(robot, Some(viewer), now);
        }
    }

    /// Does `act` to the lease of `robot`, and says what has changed.
    fn act(&mut self, robot: u32, act: Act, now: MonotonicNs, events: &mut Events) {
        let before = self.leases.get(&robot).copied().unwrap_or_default();
        let after = before.after(act, now);
        match after {
            Lease::Free => _ = self.leases.remove(&robot),
            held => _ = self.leases.insert(robot, held),
        }
        let asked = |lease| matches!(lease, Lease::Held { asked: Some(_), .. });
        let has_passed = before.holder() != after.holder();
        if has_passed {
            self.deserted.remove(&robot);
            let was_lost = matches!(act, Act::Gone(_) | Act::Time);
            let former = before.holder().and_then(|viewer| self.pages.get(&viewer));
            if let Some(name) = former.and_then(|page| page.name.clone())
                && was_lost
                && after == Lease::Free
            {
                self.deserted.insert(robot, name);
            }
            let holder = after.holder().and_then(|viewer| self.pages.get(&viewer));
            let text = match holder {
                Some(page) => format!("the page of {} commands", page.from()),
                None => "no page commands any more".to_owned(),
            };
            events.push_back(Event::Lease { robot, text });
        }
        if has_passed || asked(before) != asked(after) {
            self.say_lease(robot, None, now);
        }
    }

    /// Sends which page commands `robot`, to one page or to all that look at it.
    fn say_lease(&mut self, robot: u32, to: Option<ViewerId>, now: MonotonicNs) {
        let lease = self.leases.get(&robot).copied().unwrap_or_default();
        for (viewer, page) in &mut self.pages {
            if page.robot == Some(robot) && to.is_none_or(|to| to == *viewer) {
                page.send(&Outgoing::Lease(&lease_message(robot, lease, *viewer, now)));
            }
        }
    }

    /// The text to send next to a page.
    pub fn next(&mut self, viewer: ViewerId, now: MonotonicNs) -> Option<Arc<str>> {
        self.pages.get_mut(&viewer)?.outbox.next(now)
    }

    /// All that was made ready for a page is gone: if it has been too slow, it gets all anew.
    pub fn is_free(&mut self, viewer: ViewerId, now: MonotonicNs) {
        let Some(page) = self.pages.get_mut(&viewer) else {
            return;
        };
        if page.outbox.recover() {
            let robot = page.robot;
            self.look_at(viewer, robot, now);
        }
    }

    /// All pages are to get the past and all states anew.
    pub fn begin_anew(&mut self) {
        for page in self.pages.values_mut().filter(|page| !page.is_hidden) {
            page.has_joined = page.robot.is_some();
            page.outbox.drop_now();
        }
    }

    /// A page that is to get the past and all states.
    pub fn poll_joined(&mut self) -> Option<Event> {
        self.pages.iter_mut().find_map(|(viewer, page)| {
            let robot = page.robot.filter(|_| page.has_joined)?;
            page.has_joined = false;
            Some(Event::Joined {
                viewer: *viewer,
                robot,
            })
        })
    }

    /// The page that has been here longest without opening; `None` if all have.
    pub fn oldest_mute(&self) -> Option<ViewerId> {
        let mute = self.pages.iter().filter(|(_, page)| page.permit.is_none());
        mute.map(|(viewer, _)| *viewer).next()
    }

    /// Whether a page is here that has opened.
    pub fn has_viewers(&self) -> bool {
        self.pages.values().any(|page| page.permit.is_some())
    }

    /// The robots that pages look at.
    pub fn watched(&self) -> BTreeSet<u32> {
        self.pages.values().filter_map(|page| page.robot).collect()
    }

    /// When something is due.
    pub fn deadline(&self, now: MonotonicNs) -> Option<MonotonicNs> {
        let beat = (!self.pages.is_empty()).then_some(self.next_beat);
        let leases = self.leases.values().filter_map(|lease| lease.deadline());
        let pages = self.pages.values().filter_map(|page| match page.permit {
            None => Some(page.connected + OPEN_TIME),
            Some(_) => page.outbox.deadline(now),
        });
        leases.chain(pages).chain(beat).min()
    }

    /// Does what is due. Gives the pages that have not opened in time.
    pub fn advance(&mut self, now: MonotonicNs, events: &mut Events) -> Vec<ViewerId> {
        self.orders.advance(now);
        let robots: Vec<u32> = self.leases.keys().copied().collect();
        for robot in robots {
            self.act(robot, Act::Time, now, events);
        }
        if now >= self.next_beat && !self.pages.is_empty() {
            // After a stall beats are not made up for.
            self.next_beat = (self.next_beat + BEAT_PERIOD).max(now + BEAT_PERIOD / 2);
            let sent_ms = millis(now);
            let unix_ns = self.zero_unix_ns.map(|zero| zero.saturating_add(now.0));
            let unix_ms = unix_ns.map(|unix_ns| unix_ns / 1_000_000);
            self.say(None, &Outgoing::Beat { sent_ms, unix_ms });
        }
        let is_late =
            |page: &ConnectedPage| page.permit.is_none() && now >= page.connected + OPEN_TIME;
        self.pages
            .iter()
            .filter(|(_, page)| is_late(page))
            .map(|(viewer, _)| *viewer)
            .collect()
    }

    /// The robots that are shown from now on.
    pub fn set_robots(&mut self, robots: Vec<u32>) {
        self.robots = robots;
    }

    /// Says the same to all pages that have opened, or to those that look at `robot`. It is written once.
    pub fn say(&mut self, robot: Option<u32>, message: &Outgoing<'_>) {
        let mut text: Option<Arc<str>> = None;
        for page in self.pages.values_mut() {
            let is_meant = robot.is_none() || page.robot == robot;
            if page.permit.is_some() && is_meant {
                let text = text.get_or_insert_with(|| Arc::from(message.text()));
                page.outbox.push(text.clone());
            }
        }
    }

    /// Says something to one page, if it still looks at `robot`.
    pub fn say_to(&mut self, viewer: ViewerId, robot: u32, message: &Outgoing<'_>) {
        let page = self.pages.get_mut(&viewer);
        if let Some(page) = page.filter(|page| page.robot == Some(robot)) {
            page.send(message);
        }
    }

    /// Whether a page has the lease of this robot.
    pub fn is_commanded(&self, robot: u32) -> bool {
        let lease = self.leases.get(&robot);
        lease.is_some_and(|lease| lease.holder().is_some())
    }

    /// Puts the newest values before all pages that look at the robot.
    pub fn now(&mut self, values: &page::Now, now: MonotonicNs) {
        let mut text: Option<NowText> = None;
        let meant = |page: &&mut ConnectedPage| page.robot == Some(values.robot) && !page.is_hidden;
        for page in self.pages.values_mut().filter(meant) {
            let text = text.get_or_insert_with(|| {
                let whole = page::Now {
                    left_out: 0,
                    ..values.clone()
                };
                NowText::new(values.n, now, &Outgoing::Now(&whole).text())
            });
            page.outbox.set_now(text, now);
        }
    }

    /// Says how far an order has come, to all that look at the robot.
    pub fn report(&mut self, report: &page::OrderReport, now: MonotonicNs) {
        self.orders.report(report, now);
        self.say(Some(report.robot), &Outgoing::Order(report));
    }
}
