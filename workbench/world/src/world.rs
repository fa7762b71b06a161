//! [`play`]: lets the happenings of a script happen, step by step.

use std::fmt::Write as _;

use ipc_types::code::SenderLost;
use ipc_types::payload::MovementData;

use crate::gateway::{GatewayProcess, MavStation};
use crate::judge::{Ordered, Ran};
use crate::life::TICK_MS;
use crate::plan::PlanFlight;
use crate::plant::Plant;
use crate::record::Record;
use crate::relay::{End, Layouts, Network, RobotRelay, Station};
use crate::request::{Request, Stamp};
use crate::robot::{Robot, begin_ms};
use crate::script::{Happening, Order, Place, Process, Script, What};
use crate::view::ViewProcess;

/// How long after the last happening everything is watched.
const QUIET_MS: u64 = 5_000;
/// How long the relays have at the end to tell every client, when nothing fails any more.
const TELLING_MS: u64 = 20_000;
/// The requests of a run have greater ids.
const FIRST_ID: u64 = 100;
/// The processes of programs have numbers from here on.
const FIRST_PROCESS: u32 = 1_000;

/// What a run broke, and all that happened.
#[derive(Debug)]
pub struct Failure {
    pub what: String,
    pub log: Vec<String>,
}

struct Sender {
    place: Place,
    process: u32,
    hangs_until: u64,
    /// The last request of its last order to each robot.
    last_step: Vec<u64>,
}

/// A request of a program at a station that is on its way to its relay.
struct Sent {
    at_ms: u64,
    station: usize,
    robot: usize,
    process: u32,
    request: Request,
}

struct World {
    plant: Plant,
    begin_ms: u64,
    now_ms: u64,
    robots: Vec<Robot>,
    relays: Vec<RobotRelay>,
    records: Vec<Record>,
    /// Those of the robots whose MAVLink stations order.
    gateways: Vec<Option<GatewayProcess>>,
    /// Those of the robots whose pages order.
    views: Vec<Option<ViewProcess>>,
    stations: Vec<Station>,
    network: Network,
    layouts: Layouts,
    senders: Vec<Sender>,
    /// Programs that fly plans, and on which robot's machine.
    plans: Vec<(usize, PlanFlight)>,
    sent: Vec<Sent>,
    next_id: u64,
}

/// Plays a script, with a planted fault.
///
/// # Errors
/// What it broke.
pub fn play(script: &Script, plant: Plant) -> Result<Ran, Failure> {
    let (ran, what, log) = watch(script, plant);
    match what {
        None => Ok(ran),
        Some(what) => Err(Failure { what, log }),
    }
}

/// Plays a script, with a planted fault: what was in it, what it broke, and all that happened.
pub fn watch(script: &Script, plant: Plant) -> (Ran, Option<String>, Vec<String>) {
    let mut world = World::new(script, plant);
    let mut happenings = script.happenings.iter().peekable();
    let last_ms = script.happenings.last().map_or(0, |(at, _)| *at);
    let end_ms = world.begin_ms + last_ms + QUIET_MS;
    while world.now_ms < end_ms && !world.has_failed() {
        let passed_ms = world.now_ms - world.begin_ms;
        while let Some((_, happening)) = happenings.next_if(|(at, _)| *at <= passed_ms) {
            world.happen(happening);
        }
        world.tick();
    }
    world.finish()
}

/// Plays the run of a seed; one that fails is made shorter, and the shortest is told with its log.
///
/// # Panics
/// It fails.
pub fn play_seed(seed: u64) -> Ran {
    let script = Script::draw(seed);
    if let Ok(ran) = play(&script, Plant::Nothing) {
        return ran;
    }
    let shortest = script.shrink(|script| play(script, Plant::Nothing).is_err());
    let failure = play(&shortest, Plant::Nothing).expect_err("it failed before");
    panic!(
        "seed {seed}: {}\n{}",
        failure.what,
        told(&shortest, &failure.log)
    );
}

/// A script and what happened, for people.
pub fn told(script: &Script, log: &[String]) -> String {
    let mut text = format!(
        "robots: {}, on the ground: {}, link_loss: {:?}\n",
        script.robots, script.on_ground, script.link_loss
    );
    for (number, station) in script.stations.iter().enumerate() {
        let _ = writeln!(text, "station {number}: {station:?}");
    }
    for (number, place) in script.senders.iter().enumerate() {
        let _ = writeln!(text, "sender {number}: {place:?}");
    }
    for (at, happening) in &script.happenings {
        let _ = writeln!(text, "{at:>6} ms: {happening:?}");
    }
    text + "what happened:\n" + &log.join("\n")
}

impl World {
    fn new(script: &Script, plant: Plant) -> World {
        let begin_ms = begin_ms(script.on_ground);
        let robots: Vec<Robot> = (0..script.robots)
            .map(|index| {
                let mut robot = Robot::new(index, script, plant);
                robot.judge.link_loss = script.link_loss;
                robot
            })
            .collect();
        let count = robots.len();
        let senders_of = |wanted: fn(usize) -> Place, robot: usize| -> Vec<usize> {
            let senders = script.senders.iter().enumerate();
            let here = senders.filter(|(_, place)| **place == wanted(robot));
            here.map(|(sender, _)| sender).collect()
        };
        let station = |(index, plan)| Station::new(index, plan, 1, (count, plant), begin_ms);
        World {
            plant,
            begin_ms,
            now_ms: begin_ms,
            relays: (0..count)
                .map(|robot| RobotRelay::new(robot, 1, plant, script.link_loss))
                .collect(),
            records: (robots.iter())
                .filter(|_| script.is_recorded)
                .map(|robot| Record::new(plant, robot.host()))
                .collect(),
            gateways: (0..count)
                .map(|robot| {
                    let here = senders_of(Place::Mavlink, robot);
                    let chance = (script.seed, script.link_loss);
                    (!here.is_empty()).then(|| GatewayProcess::new(robot, &here, chance, plant))
                })
                .collect(),
            views: (0..count)
                .map(|robot| {
                    let here = senders_of(Place::Page, robot);
                    let view = || ViewProcess::new(robot, &here, begin_ms, script.seed, plant);
                    (!here.is_empty()).then(view)
                })
                .collect(),
            stations: script
                .stations
                .iter()
                .copied()
                .enumerate()
                .map(station)
                .collect(),
            network: Network::new(script.seed, &script.stations),
            layouts: Layouts::new(),
            senders: (script.senders.iter().enumerate())
                .map(|(index, place)| Sender {
                    place: *place,
                    process: FIRST_PROCESS + index as u32,
                    hangs_until: 0,
                    last_step: vec![0; count],
                })
                .collect(),
            robots,
            plans: Vec::new(),
            sent: Vec::new(),
            next_id: FIRST_ID,
        }
    }

    fn has_failed(&self) -> bool {
        let mut robots = self.robots.iter();
        robots.any(|robot| robot.judge.failure.is_some())
    }

    /// On which robot's machine a sender is.
    fn machine(&self, sender: usize) -> Option<usize> {
        match self.senders[sender].place {
            Place::Robot(robot) | Place::Mavlink(robot) | Place::Page(robot) => Some(robot),
            Place::Station(_) => None,
        }
    }

    fn happen(&mut self, happening: &Happening) {
        for robot in &mut self.robots {
            robot.judge.note(format!("{happening:?}"));
        }
        let now_ms = self.now_ms;
        if self.happen_to_page(happening) {
            return;
        }
        match *happening {
            Happening::Order(ref order) if self.mav_robot(order.sender).is_some() => {
                let robot = &self.robots[order.robot];
                if let Some(gateway) = &mut self.gateways[order.robot] {
                    gateway.order(order, robot);
                }
            }
            Happening::SenderHangs(sender, ms) if self.mav_robot(sender).is_some() => {
                self.mav_station(sender, |station| station.hangs_until = now_ms + ms);
            }
            Happening::SenderOutage(sender, ms) if self.mav_robot(sender).is_some() => {
                self.mav_station(sender, |station| station.outage_until = now_ms + ms);
            }
            // The program on the ground begins again at once.
            Happening::SenderDies(sender) if self.mav_robot(sender).is_some() => {}
            Happening::Order(ref order) => self.order(order),
            Happening::SenderDies(sender) => self.sender_dies(sender),
            Happening::SenderHangs(sender, ms) => {
                if let Some(robot) = self.machine(sender) {
                    if self.robots[robot].is_asleep() {
                        return;
                    }
                    let process = self.senders[sender].process;
                    let until = self.senders[sender].hangs_until.max(now_ms + ms);
                    self.robots[robot].process_hangs(process, until);
                }
                let sender = &mut self.senders[sender];
                sender.hangs_until = sender.hangs_until.max(now_ms + ms);
            }
            Happening::Stalls(process, ms) => self.stalls(process, now_ms + ms),
            Happening::Dies(process, ms) => self.dies(process, now_ms + ms),
            Happening::Sleep(robot, ms) => {
                self.robots[robot].sleep_until(now_ms + ms);
                self.robots[robot].truth.is_cut_off(now_ms, now_ms + ms);
                for station in &mut self.stations {
                    station.robot_sleeps(robot);
                }
            }
            Happening::Outage(station, ms) => {
                let until = &mut self.network.outage_until[station];
                *until = (*until).max(now_ms + ms);
            }
            Happening::Silence(robot, ms) => {
                self.robots[robot].silence(now_ms + ms);
                self.robots[robot].truth.is_cut_off(now_ms, now_ms + ms);
            }
            Happening::Noise(robot, ms) => self.robots[robot].noise(now_ms + ms),
            Happening::Reboot(robot) => self.robots[robot].reboot(),
            Happening::Pilot(robot, ms) => self.robots[robot].pilot(ms),
            Happening::NoFix(robot, ms) => self.robots[robot].no_fix(ms),
            Happening::DiskFails(robot, ms) => {
                if let Some(record) = self.records.get_mut(robot) {
                    record.disk_fails_until = record.disk_fails_until.max(now_ms + ms);
                }
                if let Some(gateway) = &mut self.gateways[robot] {
                    gateway.missions.slow_until = now_ms + ms;
                }
            }
            Happening::Mission(sender, ref act) => {
                let robot = self
                    .mav_robot(sender)
                    .filter(|it| !self.robots[*it].is_asleep());
                if let Some(robot) = robot
                    && let Some(gateway) = &mut self.gateways[robot]
                {
                    gateway.act(sender, act, &self.robots[robot]);
                }
            }
            Happening::Plan(sender, ref places) => {
                let Sender { place, process, .. } = self.senders[sender];
                if let Place::Robot(index) = place
                    && !self.robots[index].is_asleep()
                {
                    let robot = &self.robots[index];
                    let plan = PlanFlight::new(process, places, robot, self.plant);
                    self.plans.push((index, plan));
                }
            }
            Happening::SenderOutage(..) => {}
        }
    }

    /// Says whether it happens to a page.
    fn happen_to_page(&mut self, happening: &Happening) -> bool {
        let (Happening::SenderHangs(sender, _)
        | Happening::SenderOutage(sender, _)
        | Happening::SenderDies(sender)
        | Happening::Order(Order { sender, .. })) = *happening
        else {
            return false;
        };
        let Place::Page(robot) = self.senders[sender].place else {
            return false;
        };
        let now_ms = self.now_ms;
        if let Some(view) = &mut self.views[robot] {
            match *happening {
                Happening::SenderHangs(_, ms) => view.hangs(sender, now_ms, ms),
                Happening::SenderOutage(_, ms) => view.outage(sender, now_ms, ms),
                Happening::SenderDies(_) => view.reload(sender, now_ms),
                Happening::Order(ref order) if order.robot == robot => {
                    view.order(order, &self.robots[robot]);
                }
                _ => {}
            }
        }
        true
    }

    /// The robot of a sender that orders over MAVLink.
    fn mav_robot(&self, sender: usize) -> Option<usize> {
        match self.senders[sender].place {
            Place::Mavlink(robot) => Some(robot),
            _ => None,
        }
    }

    fn mav_station(&mut self, sender: usize, change: impl FnOnce(&mut MavStation)) {
        let gateway = self
            .mav_robot(sender)
            .and_then(|robot| self.gateways[robot].as_mut());
        if let Some(station) = gateway.and_then(|it| it.stations.get_mut(&sender)) {
            change(station);
        }
    }

    /// Whether the machine of a process is suspended.
    fn is_asleep(&self, process: Process) -> bool {
        match process {
            Process::Station(_) => false,
            Process::Bridge(robot)
            | Process::Status(robot)
            | Process::Relay(robot)
            | Process::Gateway(robot)
            | Process::View(robot)
            | Process::Recorder(robot) => self.robots[robot].is_asleep(),
        }
    }

    fn stalls(&mut self, process: Process, until: u64) {
        if self.is_asleep(process) {
            return;
        }
        match process {
            Process::Bridge(robot) => {
                let robot = &mut self.robots[robot];
                robot.bridge_life.stalls(until);
                robot.truth.is_cut_off(self.now_ms, until);
            }
            Process::Status(robot) => self.robots[robot].status_life.stalls(until),
            Process::Relay(robot) => {
                self.relays[robot].life.stalls(until);
                let process = self.relays[robot].process;
                self.robots[robot].process_hangs(process, until);
            }
            Process::Station(station) => self.stations[station].life.stalls(until),
            Process::Recorder(robot) => {
                if let Some(record) = self.records.get_mut(robot) {
                    record.life.stalls(until);
                }
            }
            Process::Gateway(robot) => {
                if let Some(gateway) = &mut self.gateways[robot] {
                    gateway.life.stalls(until);
                }
            }
            Process::View(robot) => {
                if let Some(view) = &mut self.views[robot] {
                    view.life.stalls(until);
                }
            }
        }
    }

    fn dies(&mut self, process: Process, until: u64) {
        if self.is_asleep(process) {
            return;
        }
        match process {
            Process::Bridge(robot) => {
                if self.robots[robot].bridge_life.is_up() {
                    self.robots[robot].kill_bridge(until);
                }
            }
            Process::Status(robot) => self.robots[robot].status_life.away_until = Some(until),
            Process::Relay(robot) => {
                let relay = &mut self.relays[robot];
                if relay.life.is_up() {
                    relay.life.away_until = Some(until);
                    self.robots[robot].process_ended(relay.process);
                }
            }
            Process::Gateway(robot) => {
                if let Some(gateway) = &mut self.gateways[robot]
                    && gateway.life.is_up()
                {
                    self.robots[robot].process_ended(gateway.process);
                    gateway.dies(self.now_ms, until);
                }
            }
            Process::Recorder(index) => {
                let robot = &mut self.robots[index];
                let moment = (robot.host(), robot.now_ms);
                if let Some(record) = self.records.get_mut(index) {
                    if let Err(what) = record.dies(&robot.truth, moment) {
                        robot.judge.fail(what);
                    }
                    record.life.away_until = Some(until);
                }
            }
            Process::Station(station) => {
                let station = &mut self.stations[station];
                if station.life.is_up() {
                    station.life.away_until = Some(until);
                    station.dies(&mut self.robots);
                }
            }
            Process::View(index) => {
                if let Some(view) = &mut self.views[index]
                    && view.life.is_up()
                {
                    self.robots[index].process_ended(view.process);
                    view.dies(&self.robots[index], until);
                }
            }
        }
    }

    fn sender_dies(&mut self, sender: usize) {
        let machine = self.machine(sender);
        if machine.is_some_and(|robot| self.robots[robot].is_asleep()) {
            return;
        }
        let Sender {
            place,
            process,
            hangs_until,
            last_step,
        } = &mut self.senders[sender];
        let former = *process;
        self.plans.retain(|(_, plan)| plan.process != former);
        *process += 100;
        *hangs_until = 0;
        last_step.fill(0);
        match (machine, *place) {
            (Some(robot), _) => self.robots[robot].process_ended(former),
            (None, Place::Station(station)) => {
                for sent in self.sent.extract_if(.., |sent| sent.process == former) {
                    let robot = &mut self.robots[sent.robot];
                    robot.judge.client_gone(sent.request.id());
                }
                let (robots, network) = (&mut self.robots, &mut self.network);
                self.stations[station].client_died(former, robots, network);
            }
            _ => {}
        }
    }

    /// A sender orders something: its requests are on their way.
    fn order(&mut self, order: &Order) {
        let now_ms = self.now_ms;
        let robot = &self.robots[order.robot];
        let sender = &self.senders[order.sender];
        let station = match sender.place {
            Place::Station(station) => Some(station),
            _ if robot.is_asleep() => return,
            _ => None,
        };
        let clock = match station {
            Some(station) => self.stations[station].clock(now_ms),
            None => robot.host(),
        };
        let number = robot.judge.orders.len();
        let requests = robot.requests(&order.what, self.next_id);
        self.next_id += requests.len() as u64;
        let ids: Vec<u64> = requests.iter().map(Request::id).collect();
        let within = |ms: u64| clock + std::time::Duration::from_millis(ms);
        let after = match order.is_step {
            true if self.plant != Plant::NoStep => sender.last_step[order.robot],
            _ => 0,
        };
        let stamp = Stamp {
            issued: clock,
            begin_by: order.within_ms.map(within),
            after,
        };
        let process = sender.process;
        let mut at_ms = now_ms.max(sender.hangs_until) + order.late_ms;
        self.senders[order.sender].last_step[order.robot] = ids[ids.len() - 1];
        if let [Request::Parameter(write)] = requests[..]
            && order.what == What::Write
        {
            self.robots[order.robot].judge.writes(number, write.value);
        }
        let is_vague = station.is_some_and(|station| self.stations[station].is_stale(order.robot));
        let judge = &mut self.robots[order.robot].judge;
        judge.ordered(Ordered {
            order: order.clone(),
            ids,
            after: if order.is_step { after } else { 0 },
            true_ms: now_ms,
            begin_by_ms: order.within_ms.map(|ms| now_ms + ms),
            issued_ms: now_ms,
            process: if station.is_some() { 0 } else { process },
            station,
            is_vague,
            ..Ordered::default()
        });
        if self.plant == Plant::NoStep && order.is_step {
            // The judge knows what the sender meant.
            judge.meant_after(number, judge.step_before(order.sender, number));
        }
        for request in requests {
            let request = with_terms(request, order).stamped(stamp);
            self.send(at_ms, number, order, (station, process), request);
            if let Some(copy_ms) = order.copy_ms
                && let Some(copy) = request.copy(self.plant)
            {
                self.send(at_ms + copy_ms, number, order, (station, process), copy);
            }
            at_ms += TICK_MS;
        }
    }

    fn send(
        &mut self,
        at_ms: u64,
        number: usize,
        order: &Order,
        (station, process): (Option<usize>, u32),
        request: Request,
    ) {
        let robot = &mut self.robots[order.robot];
        let Some(station) = station else {
            return robot.send(at_ms, number, process, request);
        };
        robot.judge.client_asks(request.id());
        let place = self.sent.partition_point(|other| other.at_ms <= at_ms);
        let robot = match self.plant {
            Plant::WrongRobot => (order.robot + 1) % self.robots.len(),
            _ => order.robot,
        };
        self.sent.insert(
            place,
            Sent {
                at_ms,
                station,
                robot,
                process,
                request,
            },
        );
    }

    /// One step of time for everybody.
    fn tick(&mut self) {
        self.now_ms += TICK_MS;
        self.network.now_ms = self.now_ms;
        for index in 0..self.robots.len() {
            self.tick_robot(index);
        }
        self.run_relays();
    }

    fn tick_robot(&mut self, index: usize) {
        let now_ms = self.now_ms;
        let robot = &mut self.robots[index];
        let relay = &mut self.relays[index];
        let mut record = self.records.get_mut(index);
        let is_here = |place: Place| match place {
            Place::Robot(robot) | Place::Mavlink(robot) => robot == index,
            Place::Page(_) | Place::Station(_) => false,
        };
        let senders = self.senders.iter();
        let awake = senders.filter(|it| is_here(it.place) && it.hangs_until <= now_ms);
        let mut awake: Vec<u32> = awake.map(|sender| sender.process).collect();
        if relay.life.is_awake(now_ms) {
            awake.push(relay.process);
        }
        let view = &mut self.views[index];
        let gateway = &mut self.gateways[index];
        if let Some(gateway) = gateway.as_ref().filter(|it| it.life.is_awake(now_ms)) {
            awake.push(gateway.process);
        }
        robot.tick(&awake);
        if robot.is_asleep() {
            relay.life.sleeps();
            if let Some(record) = &mut record {
                record.life.sleeps();
            }
            for sender in &mut self.senders {
                if is_here(sender.place) && sender.hangs_until >= now_ms {
                    sender.hangs_until += TICK_MS;
                }
            }
        }
        for hero in &robot.samples {
            relay.sample(hero);
            if let Some(record) = record.as_mut().filter(|record| record.life.is_up()) {
                record.sample(hero);
            }
        }
        if let Some(record) = record.filter(|_| !robot.is_asleep()) {
            record.life.begins(now_ms);
            if record.life.is_awake(now_ms) {
                record.step(robot.host(), now_ms);
            }
        }
        for (process, report) in std::mem::take(&mut robot.reports) {
            if process == relay.process {
                relay.report(report);
            } else if let Some(gateway) = gateway.as_mut().filter(|it| it.process == process) {
                gateway.report(report);
            } else if let Some(view) = view.as_mut().filter(|it| it.process == process) {
                view.report(report);
            }
            let plans = self.plans.iter_mut().filter(|(of, _)| *of == index);
            for (_, plan) in plans.filter(|(_, plan)| plan.process == process) {
                plan.report(&report, robot);
            }
        }
        let plans = self
            .plans
            .iter_mut()
            .filter(|(of, _)| *of == index && !robot.is_asleep());
        for (_, plan) in plans
            .filter(|(_, plan)| awake.contains(&plan.process))
            .collect::<Vec<_>>()
        {
            plan.step(robot, &mut self.next_id);
        }
        if let Some(view) = view {
            if view.life.is_up() {
                view.published(robot);
            }
            view.run_pages(robot);
            match robot.is_asleep() {
                true => view.life.sleeps(),
                false => _ = view.life.begins(now_ms),
            }
            if view.life.is_awake(now_ms) && !robot.is_asleep() {
                view.step(robot, &mut self.next_id);
            }
        }
        if let Some(gateway) = gateway {
            if let Some(hero) = robot.samples.last().filter(|_| gateway.life.is_up()) {
                gateway.sample(hero);
            }
            gateway.run_stations(robot);
            if robot.is_asleep() {
                gateway.life.sleeps();
            } else {
                gateway.runs_disk(now_ms);
                if gateway.life.begins(now_ms) {
                    gateway.begins();
                }
            }
            if gateway.life.is_awake(now_ms) && !robot.is_asleep() {
                gateway.step(robot, &mut self.next_id);
            } else {
                robot.judge.gateway_pauses();
            }
        }
        if !relay.life.is_awake(now_ms) || robot.is_asleep() {
            robot.judge.relay_pauses();
            (0..self.stations.len()).for_each(|station| robot.judge.link_is_bad(station));
        }
    }

    /// Messages between relays arrive, and the relays that are awake do what is due.
    fn run_relays(&mut self) {
        let now_ms = self.now_ms;
        for (robot, station, to, message) in self.network.take() {
            match to {
                End::Robot
                    if self.relays[robot].life.is_up() && !self.robots[robot].is_asleep() =>
                {
                    self.relays[robot].receive(station, message);
                }
                End::Station if self.stations[station].life.is_up() => {
                    self.stations[station].receive(robot, message);
                }
                _ => {}
            }
        }
        let due = self.sent.partition_point(|sent| sent.at_ms <= now_ms);
        for sent in self.sent.drain(..due) {
            let network = (&mut self.network, &self.layouts);
            let robot = &mut self.robots[sent.robot];
            self.stations[sent.station].request(sent.process, sent.request, robot, network);
        }
        for (index, robot) in self.robots.iter_mut().enumerate() {
            if robot.is_asleep() {
                continue;
            }
            if self.relays[index].life.begins(now_ms) {
                self.relays[index] = self.relays[index].next(index);
                robot.judge.note("its relay begins again".to_owned());
            }
            if self.relays[index].life.is_awake(now_ms) {
                self.relays[index].step(robot, &mut self.network, &self.layouts);
            }
        }
        for index in 0..self.stations.len() {
            if self.stations[index].life.begins(now_ms) {
                self.stations[index] = self.stations[index].next(now_ms);
            }
            let is_awake = self.stations[index].life.is_awake(now_ms);
            if !is_awake || self.network.is_bad(index) {
                for robot in &mut self.robots {
                    robot.judge.link_is_bad(index);
                }
            }
            if is_awake {
                let (robots, network) = (&mut self.robots, &mut self.network);
                self.stations[index].step(robots, network, &self.layouts);
            }
        }
    }

    /// The bridges end, the links are good, and everybody who asked is told.
    fn finish(mut self) -> (Ran, Option<String>, Vec<String>) {
        for robot in &mut self.robots {
            robot.asleep_until = 0;
            robot.close();
        }
        self.network.heal();
        for relay in &mut self.relays {
            relay.life.away_until = relay.life.away_until.map(|_| 0);
            relay.life.stalls_until = 0;
        }
        for station in &mut self.stations {
            station.life.away_until = station.life.away_until.map(|_| 0);
            station.life.stalls_until = 0;
        }
        self.views.iter_mut().flatten().for_each(ViewProcess::heal);
        let end_ms = self.now_ms + TELLING_MS;
        let has_waiting = |world: &World| {
            let mut robots = world.robots.iter();
            let mut views = world.views.iter().flatten();
            robots.any(|robot| robot.judge.has_waiting()) || views.any(ViewProcess::has_waiting)
        };
        while has_waiting(&self) && self.now_ms < end_ms && !self.has_failed() {
            self.now_ms += TICK_MS;
            self.network.now_ms = self.now_ms;
            let others = self.relays.iter_mut().zip(&mut self.views);
            for (robot, (relay, view)) in self.robots.iter_mut().zip(others) {
                (robot.now_ms, robot.judge.now_ms) = (self.now_ms, self.now_ms);
                for (process, report) in std::mem::take(&mut robot.reports) {
                    if process == relay.process {
                        relay.report(report);
                    } else if let Some(view) = view.as_mut().filter(|it| it.process == process) {
                        view.report(report);
                    }
                }
                if let Some(view) = view {
                    view.life.begins(self.now_ms);
                    view.run_pages(robot);
                    view.step(robot, &mut self.next_id);
                }
            }
            self.run_relays();
        }
        let mut ran = Ran {
            runs: 1,
            ..Ran::default()
        };
        for (view, robot) in self.views.iter().zip(&mut self.robots) {
            if let Some(view) = view.as_ref().filter(|_| robot.judge.failure.is_none()) {
                view.all_told(robot);
            }
        }
        for (gateway, robot) in self.gateways.iter().zip(&mut self.robots) {
            if let Some(gateway) = gateway.as_ref().filter(|_| robot.judge.failure.is_none()) {
                gateway.all_answered(robot);
            }
        }
        let (mut what, mut log) = (None, Vec::new());
        let mut records = self.records.into_iter();
        for mut robot in self.robots {
            let moment = (robot.host(), robot.now_ms);
            let ended = records
                .next()
                .map(|record| record.ends(&robot.truth, moment));
            if let Some(Err(what)) = ended {
                robot.judge.fail(what);
            }
            if robot.judge.failure.is_none() {
                robot.judge.all_told();
            }
            ran += robot.judge.ran;
            what = what.or(robot.judge.failure);
            log.extend(robot.judge.log);
        }
        log.sort_by_key(|(at, _)| *at);
        let log = log.into_iter();
        let log = log.map(|(at, text)| format!("{:>8} ms  {text}", at - self.begin_ms));
        (ran, what, log.collect())
    }
}

/// What an order says of its sender, in its request.
fn with_terms(request: Request, order: &Order) -> Request {
    match request {
        Request::Movement(data) if data.path_id != 0 => Request::Movement(MovementData {
            lease_ms: order.lease_ms.unwrap_or_default(),
            sender_lost: order.lost.map_or(0, SenderLost::code),
            ..data
        }),
        request => request,
    }
}
