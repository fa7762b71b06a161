//! What happens in one run of the order machine, as data: it is drawn by a seed, printed, and made shorter.

use ipc_types::code::SenderLost;

use crate::missions::dice::Dice;

/// The acts of a run begin before.
const ACTS_MS: u64 = 12_000;

/// Most senders.
const SENDERS: u64 = 4;

/// A run.
#[derive(Clone, Debug, Default)]
pub struct Sequence {
    /// The helicopter stands, and the module was never started; otherwise it hovers.
    pub on_ground: bool,
    pub senders: Vec<SenderPlan>,
    /// When and what, in order.
    pub acts: Vec<(u64, Act)>,
}

/// A sender, and how well the robot knows its clock.
#[derive(Clone, Copy, Debug)]
pub struct SenderPlan {
    /// 0 on the robot.
    pub origin: u32,
    /// What its clock is known to, ms.
    pub within_ms: u64,
    /// By how much its orders seem older than they are, ms; no more than `within_ms`.
    pub error_ms: u64,
}

/// What happens at a moment.
#[derive(Clone, Debug, PartialEq)]
pub enum Act {
    /// A sender orders something.
    Order(Order),
    /// Its process ends; the sender goes on with a new one.
    Dies(usize),
    /// Its process stands still.
    Hangs(usize, u64),
    /// The bridge's process stands still.
    Stall(u64),
    /// The machine is suspended: its processes and its monotonic clock stand still, and nobody orders anything.
    Sleep(u64),
    /// Nothing passes the line to the DSP, in both directions.
    Silence(u64),
    /// Of the bytes on the line, one in a hundred is damaged.
    Noise(u64),
    /// The DSP boots again.
    Reboot,
    /// The bridge is killed, and begins again after this time.
    Restart(u64),
    /// The pilot's switch is on manual.
    Pilot(u64),
    /// The GPS has no fix.
    NoFix(u64),
}

/// An order.
#[derive(Clone, Debug, PartialEq)]
pub struct Order {
    pub sender: usize,
    pub what: What,
    /// How long it is on its way, ms.
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
}

impl What {
    /// Counts whatever its moment.
    pub fn ends_movements(&self) -> bool {
        matches!(self, What::Hold | What::Land | What::Stop)
    }
}

impl Sequence {
    /// The sequence of a seed.
    pub fn draw(seed: u64) -> Sequence {
        let dice = &mut Dice::new(seed);
        let senders: Vec<SenderPlan> = (0..dice.count(2, SENDERS))
            .map(|number| match dice.once_in(3) {
                false => SenderPlan {
                    origin: 0,
                    within_ms: 0,
                    error_ms: 0,
                },
                true => {
                    let within_ms = dice.count(0, 300);
                    SenderPlan {
                        origin: number as u32 + 1,
                        within_ms,
                        error_ms: dice.count(0, within_ms),
                    }
                }
            })
            .collect();
        let mut acts: Vec<(u64, Act)> = (0..dice.count(6, 20))
            .map(|_| (dice.count(0, ACTS_MS), draw_act(dice, senders.len())))
            .collect();
        let on_ground = dice.once_in(4);
        if on_ground {
            let sender = dice.count(0, senders.len() as u64 - 1) as usize;
            let start = Order::at_once(sender, What::Start);
            let take_off = Order {
                what: What::TakeOff,
                ..draw_order(dice, sender)
            };
            acts.push((dice.count(0, 500), Act::Order(start)));
            acts.push((dice.count(500, 3000), Act::Order(take_off)));
        }
        acts.sort_by_key(|(at, _)| *at);
        Sequence {
            on_ground,
            senders,
            acts,
        }
    }

    /// The shortest sequence that still `fails`, as far as leaving out and simplifying acts one by one finds it.
    pub fn shrink(mut self, fails: impl Fn(&Sequence) -> bool) -> Sequence {
        let mut is_shorter = true;
        while is_shorter {
            is_shorter = false;
            let mut index = 0;
            while index < self.acts.len() {
                let mut without = self.clone();
                without.acts.remove(index);
                if fails(&without) {
                    (self, is_shorter) = (without, true);
                    continue;
                }
                for simpler in self.acts[index].1.simpler() {
                    let mut other = self.clone();
                    other.acts[index].1 = simpler;
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

impl Order {
    /// An order that comes at once, and says nothing but what it is.
    pub fn at_once(sender: usize, what: What) -> Order {
        Order {
            sender,
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

impl Act {
    /// What is a little less than this act.
    fn simpler(&self) -> Vec<Act> {
        let Act::Order(order) = self else {
            return Vec::new();
        };
        let mut simpler = Vec::new();
        let mut with = |is_there: bool, change: fn(&mut Order)| {
            if is_there {
                let mut other = order.clone();
                change(&mut other);
                simpler.push(Act::Order(other));
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

fn draw_act(dice: &mut Dice, senders: usize) -> Act {
    let sender = dice.count(0, senders as u64 - 1) as usize;
    match dice.count(0, 40) {
        0 | 1 => Act::Dies(sender),
        2 => Act::Hangs(sender, dice.count(200, 4000)),
        3..=5 => Act::Stall(dice.count(50, 2500)),
        6 => Act::Silence(dice.count(50, 2500)),
        7 => Act::Noise(dice.count(100, 2000)),
        8 => Act::Reboot,
        9 => Act::Restart(dice.count(50, 2000)),
        10 => Act::Pilot(dice.count(100, 3000)),
        11 => Act::NoFix(dice.count(100, 3000)),
        12 => Act::Sleep(dice.count(50, 4000)),
        _ => Act::Order(draw_order(dice, sender)),
    }
}

fn draw_order(dice: &mut Dice, sender: usize) -> Order {
    let what = match dice.count(0, 16) {
        0 => What::Land,
        16 => What::TakeOff,
        1 | 2 => What::Hold,
        3 => What::Stop,
        4..=6 => What::Start,
        _ => {
            let place = |dice: &mut Dice| (dice.within(-26.0, 26.0), dice.within(-26.0, 26.0));
            What::Path((0..dice.count(1, 2)).map(|_| place(dice)).collect())
        }
    };
    Order {
        sender,
        what,
        late_ms: if dice.once_in(3) {
            dice.count(0, 3000)
        } else {
            dice.count(0, 30)
        },
        copy_ms: dice.once_in(4).then(|| dice.count(0, 3000)),
        within_ms: dice.once_in(3).then(|| dice.count(100, 3000)),
        is_step: dice.once_in(3),
        lost: match dice.count(0, 5) {
            0 => Some(SenderLost::Continue),
            1 => Some(SenderLost::Land),
            2 => Some(SenderLost::Hold),
            _ => None,
        },
        lease_ms: dice.once_in(4).then(|| dice.count(500, 2000) as u32),
    }
}
