//! What happens in one run of the world, as data: a seed draws it, it is printed, and made shorter when it fails.

use dsp_sim::random::Random;
use ipc_types::code::SenderLost;

/// The happenings of a run begin within so long, ms: before the first, the stations have found their robots.
pub const FIRST_MS: u64 = 1_000;
const LAST_MS: u64 = 13_000;

/// A station with an order under way that is silent for so long is lost, and so is one of MAVLink.
pub const LINK_LOSS_MS: u64 = 2_000;
pub const STATION_LOST_MS: u64 = 3_000;

/// Most senders.
const SENDERS: u64 = 4;

/// The stream of a seed that draws what happens; the simulator and the network have others.
const STREAM: u64 = 11;

/// A run.
#[derive(Clone, Debug, Default)]
pub struct Script {
    pub seed: u64,
    /// The helicopters stand, and no module was ever started; otherwise they hover.
    pub on_ground: bool,
    /// How many robots there are.
    pub robots: usize,
    /// What the robots' relays do when a station is lost with an order under way.
    pub link_loss: LinkLoss,
    pub stations: Vec<StationPlan>,
    /// Whether the robots are recorded.
    pub is_recorded: bool,
    /// Where each sender is.
    pub senders: Vec<Place>,
    /// When and what, in order.
    pub happenings: Vec<(u64, Happening)>,
}

/// What the robots' relays do when a station is lost with an order under way.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum LinkLoss {
    #[default]
    Continue,
    Hold,
    Land,
}

/// A station's machine, and its way to the robots.
#[derive(Clone, Copy, Debug)]
pub struct StationPlan {
    /// What its clock shows when the world begins, s.
    pub clock_s: u64,
    /// How many ns its clock gains in a second.
    pub drift_ppb: i64,
    /// One message in so many is lost, or comes twice; 0 for none.
    pub loses_one_in: u64,
    pub doubles_one_in: u64,
    /// A message is at most so long on its way, and one in twenty ten times as long, ms.
    pub delay_ms: u64,
}

/// Where a sender is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Place {
    /// A program on the machine of this robot, which orders that one alone.
    Robot(usize),
    /// A program on the machine of this station, which orders any robot.
    Station(usize),
    /// A ground station of MAVLink, at the gateway of this robot.
    Mavlink(usize),
    /// A page in a browser, at the view of this robot.
    Page(usize),
}

/// Which station of the judge a sender of MAVLink is.
pub fn station_of(sender: usize) -> usize {
    1_000 + sender
}

/// A process that can stand still, and die.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Process {
    Bridge(usize),
    Status(usize),
    Relay(usize),
    Station(usize),
    Gateway(usize),
    View(usize),
    Recorder(usize),
}

/// What happens at a moment.
#[derive(Clone, Debug, PartialEq)]
pub enum Happening {
    /// A sender orders something.
    Order(Order),
    /// The process of a sender ends; it goes on with a new one.
    SenderDies(usize),
    /// The process of a sender stands still.
    SenderHangs(usize, u64),
    /// A process stands still.
    Stalls(Process, u64),
    /// A process is killed, and begins again after this time.
    Dies(Process, u64),
    /// The robot's machine is suspended: its processes and its monotonic clock stand still, and nobody there orders.
    Sleep(usize, u64),
    /// Nothing passes between this station and any robot.
    Outage(usize, u64),
    /// Nothing passes the line to the DSP of this robot, in both directions.
    Silence(usize, u64),
    /// Of the bytes on the line, one in a hundred is damaged.
    Noise(usize, u64),
    /// The DSP boots again.
    Reboot(usize),
    /// The pilot's switch is on manual.
    Pilot(usize, u64),
    /// The GPS has no fix.
    NoFix(usize, u64),
    /// The disk of this robot's recorder takes nothing.
    DiskFails(usize, u64),
    /// Nothing passes to and from this MAVLink station or page.
    SenderOutage(usize, u64),
    /// A MAVLink station does something about missions.
    Mission(usize, MissionAct),
    /// A program flies a plan to these places, east and north of home, m, with a hover at each, ms.
    Plan(usize, Vec<(f64, f64, u64)>),
}

/// What a MAVLink station does about missions.
#[derive(Clone, Debug, PartialEq)]
pub enum MissionAct {
    /// It sends one of these places, as [`Happening::Plan`] has them.
    Upload(Vec<(f64, f64, u64)>),
    Clear,
    Start,
    /// It lets one go on that is paused.
    Continue,
}

/// An order.
#[derive(Clone, Debug, PartialEq)]
pub struct Order {
    pub sender: usize,
    pub robot: usize,
    pub what: What,
    /// How long it is on its way to the first process that reads it, ms.
    pub late_ms: u64,
    /// A copy of it, which says that it is one, comes so much later, ms.
    pub copy_ms: Option<u64>,
    /// Until how long after its issue it may begin, ms; by default as the bridge says.
    pub within_ms: Option<u64>,
    /// It is the next step after what the sender ordered before.
    pub is_step: bool,
    /// What becomes of a path without its sender.
    pub lost: Option<SenderLost>,
    /// The sender renews a path so often, ms.
    pub lease_ms: Option<u32>,
}

/// What is ordered.
#[derive(Clone, Debug, PartialEq)]
pub enum What {
    /// To these places: east and north of home, m.
    Path(Vec<(f64, f64)>),
    TakeOff,
    Hold,
    Land,
    Start,
    Stop,
    /// A value of its own into a port of the DSP.
    Write,
    /// The value of that port.
    Read,
}

impl What {
    /// It is about the port, and moves nothing.
    pub fn is_parameter(&self) -> bool {
        matches!(self, What::Write | What::Read)
    }

    /// Counts whatever its moment.
    pub fn ends_movements(&self) -> bool {
        matches!(self, What::Hold | What::Land | What::Stop)
    }
}

/// Chance that a seed repeats.
#[derive(Clone, Debug)]
pub struct Dice(Random);

impl Dice {
    pub fn new(seed: u64, stream: u64) -> Dice {
        Dice(Random::new(seed, stream))
    }

    /// Between the two, which may both be.
    pub fn count(&mut self, low: u64, high: u64) -> u64 {
        low + self.0.next_u64() % (high - low + 1)
    }

    pub fn once_in(&mut self, count: u64) -> bool {
        self.count(1, count) == 1
    }

    fn within(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * self.0.uniform()
    }

    fn index(&mut self, length: usize) -> usize {
        self.count(0, length as u64 - 1) as usize
    }
}

impl Script {
    /// The run of a seed.
    pub fn draw(seed: u64) -> Script {
        let dice = &mut Dice::new(seed, STREAM);
        let robots = if dice.once_in(5) { 2 } else { 1 };
        let stations: Vec<StationPlan> =
            (0..dice.count(0, 2)).map(|_| draw_station(dice)).collect();
        let mut senders = vec![Place::Robot(0)];
        for _ in 1..dice.count(2, SENDERS) {
            let robot = dice.index(robots);
            senders.push(match dice.count(0, 9) {
                0..=3 if !stations.is_empty() => Place::Station(dice.index(stations.len())),
                4 | 5 => Place::Mavlink(robot),
                6 | 7 => Place::Page(robot),
                _ => Place::Robot(robot),
            });
        }
        let mut script = Script {
            seed,
            on_ground: dice.once_in(4),
            robots,
            link_loss: match dice.count(0, 3) {
                0 | 1 => LinkLoss::Continue,
                2 => LinkLoss::Hold,
                _ => LinkLoss::Land,
            },
            stations,
            is_recorded: dice.once_in(4),
            senders,
            happenings: Vec::new(),
        };
        // In some little happens, so that what is flown goes on.
        let (least, most) = if dice.once_in(4) { (1, 4) } else { (6, 20) };
        script.happenings = (0..dice.count(least, most))
            .map(|_| (dice.count(FIRST_MS, LAST_MS), script.draw_happening(dice)))
            .collect();
        script.draw_missions(dice);
        script.draw_absences(dice);
        script.draw_rivals(dice);
        if script.on_ground {
            let sender = dice.index(script.senders.len());
            let robot = script.robot_of(sender, dice);
            let start = Order::at_once(sender, robot, What::Start);
            let take_off = Order {
                robot,
                what: What::TakeOff,
                ..script.draw_order(dice, sender)
            };
            let begin = dice.count(FIRST_MS, FIRST_MS + 500);
            script.happenings.push((begin, Happening::Order(start)));
            let begin = dice.count(begin, begin + 2_500);
            script.happenings.push((begin, Happening::Order(take_off)));
        }
        script.happenings.sort_by_key(|(at, _)| *at);
        script
    }

    /// Most MAVLink stations send a mission, have it flown, and let it go on.
    fn draw_missions(&mut self, dice: &mut Dice) {
        for (sender, place) in self.senders.clone().into_iter().enumerate() {
            let Place::Mavlink(robot) = place else {
                continue;
            };
            if dice.once_in(3) {
                continue;
            }
            let mut at = dice.count(FIRST_MS, FIRST_MS + 1_500);
            let mut places = draw_places(dice);
            let is_killed = dice.once_in(3);
            if is_killed {
                // Its gateway is killed in the middle, between two items, and little else happens.
                self.happenings.truncate(2);
                for number in places.len()..4 {
                    let at_m = number as f64;
                    places.push((6.0 - at_m, 2.0 * at_m - 6.0, 400));
                }
                places
                    .iter_mut()
                    .for_each(|(_, _, hover_ms)| *hover_ms += 200);
            }
            let mut acts = vec![MissionAct::Upload(places), MissionAct::Start];
            let most = if is_killed { 0 } else { 2 };
            acts.extend((0..dice.count(0, most)).map(|_| MissionAct::Continue));
            for act in acts {
                self.happenings.push((at, Happening::Mission(sender, act)));
                at += dice.count(500, 4_000);
            }
            if is_killed {
                let at = at + dice.count(3_000, 9_000);
                let dies = Happening::Dies(Process::Gateway(robot), dice.count(50, 1_000));
                let goes_on = Happening::Mission(sender, MissionAct::Continue);
                let later = at + dice.count(1_500, 3_000);
                self.happenings.extend([(at, dies), (later, goes_on)]);
            }
        }
    }

    /// Some senders on the ground are not heard any more while what they have ordered goes on.
    fn draw_absences(&mut self, dice: &mut Dice) {
        let mut absences = Vec::new();
        for (at, happening) in &self.happenings {
            let sender = match happening {
                Happening::Order(Order {
                    sender,
                    what: What::Path(_),
                    ..
                })
                | Happening::Mission(sender, MissionAct::Start) => *sender,
                _ => continue,
            };
            let from_ms = at + dice.count(200, 2_000);
            let absence = match self.senders[sender] {
                Place::Robot(_) => continue,
                Place::Station(_) => Happening::SenderDies(sender),
                _ => Happening::SenderOutage(sender, dice.count(2_500, 7_000)),
            };
            let one_in = if absence == Happening::SenderDies(sender) {
                2
            } else {
                4
            };
            if dice.once_in(one_in) {
                absences.push((from_ms, absence));
            }
        }
        self.happenings.extend(absences);
    }

    /// Some orders have another one of another sender at their heels, or just before them.
    fn draw_rivals(&mut self, dice: &mut Dice) {
        let mut rivals = Vec::new();
        for (at, happening) in &self.happenings {
            if let Happening::Plan(..) = happening {
                // It is disturbed while it hovers or flies.
                let sender = dice.index(self.senders.len());
                let hold = Order::at_once(sender, self.robot_of(sender, dice), What::Hold);
                rivals.push((at + dice.count(1_500, 8_000), Happening::Order(hold)));
            }
            let Happening::Order(order) = happening else {
                continue;
            };
            if dice.once_in(4) {
                let sender = dice.index(self.senders.len());
                let rival = self.draw_order(dice, sender);
                let is_other = self.robot_of(sender, dice) != order.robot;
                let robot = if is_other { rival.robot } else { order.robot };
                let rival = Order { robot, ..rival };
                let most = if dice.once_in(2) { 40 } else { 300 };
                rivals.push((at + dice.count(0, most), Happening::Order(rival)));
            }
        }
        self.happenings.extend(rivals);
    }

    fn robot_of(&self, sender: usize, dice: &mut Dice) -> usize {
        match self.senders[sender] {
            Place::Robot(robot) | Place::Mavlink(robot) | Place::Page(robot) => robot,
            Place::Station(_) => dice.index(self.robots),
        }
    }

    fn draw_happening(&self, dice: &mut Dice) -> Happening {
        let sender = dice.index(self.senders.len());
        let robot = dice.index(self.robots);
        match dice.count(0, 47) {
            0 | 1 => Happening::SenderDies(sender),
            2 => Happening::SenderHangs(sender, dice.count(200, 4_000)),
            3..=5 => Happening::Stalls(self.draw_process(dice, robot), dice.count(50, 2_500)),
            6 => Happening::Silence(robot, dice.count(50, 2_500)),
            7 => Happening::Noise(robot, dice.count(100, 2_000)),
            8 => Happening::Reboot(robot),
            9..=11 => Happening::Dies(self.draw_process(dice, robot), dice.count(50, 2_000)),
            12 => Happening::Pilot(robot, dice.count(100, 3_000)),
            13 => Happening::NoFix(robot, dice.count(100, 3_000)),
            14 => Happening::Sleep(robot, dice.count(50, 4_000)),
            15 | 16 if !self.stations.is_empty() => {
                Happening::Outage(dice.index(self.stations.len()), dice.count(200, 6_000))
            }
            17 => Happening::DiskFails(robot, dice.count(200, 6_000)),
            18 | 19 => Happening::SenderOutage(sender, dice.count(200, 6_000)),
            20..=23 if matches!(self.senders[sender], Place::Mavlink(_)) => {
                let act = match dice.count(0, 9) {
                    0 => MissionAct::Clear,
                    1 | 2 => MissionAct::Upload(draw_places(dice)),
                    3..=5 => MissionAct::Start,
                    _ => MissionAct::Continue,
                };
                Happening::Mission(sender, act)
            }
            20 | 21 if matches!(self.senders[sender], Place::Robot(_)) => {
                Happening::Plan(sender, draw_places(dice))
            }
            _ => Happening::Order(self.draw_order(dice, sender)),
        }
    }

    /// The bridge as often as all others together.
    fn draw_process(&self, dice: &mut Dice, robot: usize) -> Process {
        match dice.count(0, 11) {
            0 => Process::Status(robot),
            1 => Process::Gateway(robot),
            2 => Process::View(robot),
            3 => Process::Recorder(robot),
            4 | 5 if !self.stations.is_empty() => Process::Station(dice.index(self.stations.len())),
            4..=6 => Process::Relay(robot),
            _ => Process::Bridge(robot),
        }
    }

    fn draw_order(&self, dice: &mut Dice, sender: usize) -> Order {
        let is_page = matches!(self.senders[sender], Place::Page(_));
        let what = match dice.count(0, 19) {
            0 => What::Land,
            16 => What::TakeOff,
            17 | 18 if !is_page => What::Write,
            19 if !is_page => What::Read,
            1 | 2 => What::Hold,
            3 => What::Stop,
            4..=6 => What::Start,
            _ => {
                let place = |dice: &mut Dice| (dice.within(-26.0, 26.0), dice.within(-26.0, 26.0));
                What::Path((0..dice.count(1, 2)).map(|_| place(dice)).collect())
            }
        };
        let is_late = dice.once_in(3);
        Order {
            sender,
            robot: self.robot_of(sender, dice),
            what,
            late_ms: dice.count(0, if is_late { 3_000 } else { 30 }),
            copy_ms: dice.once_in(4).then(|| dice.count(0, 3_000)),
            within_ms: dice.once_in(3).then(|| dice.count(100, 3_000)),
            is_step: dice.once_in(3),
            lost: match dice.count(0, 5) {
                0 => Some(SenderLost::Continue),
                1 => Some(SenderLost::Land),
                2 => Some(SenderLost::Hold),
                _ => None,
            },
            lease_ms: dice.once_in(4).then(|| dice.count(500, 2_000) as u32),
        }
    }

    /// The shortest run that still `fails`, as far as leaving out and simplifying happenings one by one finds it.
    pub fn shrink(mut self, fails: impl Fn(&Script) -> bool) -> Script {
        let mut is_shorter = true;
        while is_shorter {
            is_shorter = false;
            let mut index = 0;
            while index < self.happenings.len() {
                let mut without = self.clone();
                without.happenings.remove(index);
                if fails(&without) {
                    (self, is_shorter) = (without, true);
                    continue;
                }
                for simpler in self.happenings[index].1.simpler() {
                    let mut other = self.clone();
                    other.happenings[index].1 = simpler;
                    if fails(&other) {
                        (self, is_shorter) = (other, true);
                        break;
                    }
                }
                index += 1;
            }
        }
        self
    }
}

/// Of one to four places. After one without a hover comes one with it: a path has two places at most.
fn draw_places(dice: &mut Dice) -> Vec<(f64, f64, u64)> {
    let count = dice.count(1, 4);
    let place = |index: u64, dice: &mut Dice| {
        let is_passed = index.is_multiple_of(2) && index + 1 < count && dice.once_in(2);
        let hover_ms = if is_passed { 0 } else { dice.count(1, 8) * 200 };
        (dice.within(-8.0, 8.0), dice.within(-8.0, 8.0), hover_ms)
    };
    (0..count).map(|index| place(index, dice)).collect()
}

fn draw_station(dice: &mut Dice) -> StationPlan {
    StationPlan {
        clock_s: dice.count(1_000, 1_000_000),
        drift_ppb: dice.count(0, 180_000) as i64 - 90_000,
        loses_one_in: if dice.once_in(2) {
            dice.count(3, 20)
        } else {
            0
        },
        doubles_one_in: if dice.once_in(2) {
            dice.count(3, 20)
        } else {
            0
        },
        delay_ms: [1, 10, 50, 200][dice.index(4)],
    }
}

impl Order {
    /// An order that comes at once, and says nothing but what it is.
    pub fn at_once(sender: usize, robot: usize, what: What) -> Order {
        Order {
            sender,
            robot,
            what,
            late_ms: 0,
            copy_ms: None,
            within_ms: None,
            is_step: false,
            lost: None,
            lease_ms: None,
        }
    }
}

impl Happening {
    /// What is a little less than this.
    fn simpler(&self) -> Vec<Happening> {
        let Happening::Order(order) = self else {
            return Vec::new();
        };
        let mut simpler = Vec::new();
        let mut with = |is_there: bool, change: fn(&mut Order)| {
            if is_there {
                let mut other = order.clone();
                change(&mut other);
                simpler.push(Happening::Order(other));
            }
        };
        with(order.late_ms > 0, |order| order.late_ms = 0);
        with(order.copy_ms.is_some(), |order| order.copy_ms = None);
        with(order.within_ms.is_some(), |order| order.within_ms = None);
        with(order.is_step, |order| order.is_step = false);
        with(order.lost.is_some(), |order| order.lost = None);
        with(order.lease_ms.is_some(), |order| order.lease_ms = None);
        simpler
    }
}
